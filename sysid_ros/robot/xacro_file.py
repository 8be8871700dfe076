"""urdf_of_xacro: a robot that is written as macros, expanded by xacro."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from sysid_ros.exceptions import RobotModelError

_LONGEST = 120.0
"""xacro takes a second; a file that includes itself takes for ever [s]."""
_LAST_LINES = 3


def is_xacro(path: Path, text: str) -> bool:
    """Whether a file is to be expanded before it is a URDF."""
    return path.suffix == ".xacro" or "<xacro:" in text


def with_arguments(given: str) -> tuple[str, list[str]]:
    """Path and arguments of ``"arm.urdf.xacro ur_type:=ur10e prefix:=left_"``."""
    path, *words = given.split(" ")
    while words and ":=" not in words[0]:
        path = f"{path} {words.pop(0)}"
    return path, [word for word in words if word]


def urdf_of_xacro(path: Path, arguments: Sequence[str] = ()) -> str:
    """The URDF that xacro makes of a file.

    Args:
        path: the file. arguments: of it, ``name:=value`` each.

    Raises:
        RobotModelError: xacro is not installed, or can't expand the file.
    """
    again = " ".join(["xacro", path.name, *arguments])
    command = _command()
    if not command:
        raise RobotModelError(
            f"'{path}' is a xacro file, and xacro is not installed: pip install 'sysid_ros[xacro]', or source ROS 2. "
            f"Or expand it elsewhere first: {again} > robot.urdf"
        )
    try:
        done = subprocess.run([*command, str(path), *arguments], capture_output=True, text=True, timeout=_LONGEST, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise RobotModelError(f"xacro can't expand '{path}': {error}. Try it by itself: {again}") from error
    if done.returncode != 0:
        last = [line.strip() for line in done.stderr.strip().splitlines()[-_LAST_LINES:]]
        said = "; ".join(last) or f"it ends with {done.returncode}"
        raise RobotModelError(
            f"xacro can't expand '{path}': {said}. Arguments stand behind the file: --urdf '{path.name} name:=value'. Packages "
            "that it names must be installed or sourced."
        )
    return done.stdout


def _command() -> list[str]:
    """What runs xacro: the module in this Python, else the command of a sourced workspace; nothing where there is neither."""
    if importlib.util.find_spec("xacro") is not None:
        return [sys.executable, "-c", "import xacro; xacro.main()"]
    found = shutil.which("xacro")
    return [found] if found else []
