"""``sysid doctor``: what is installed, what works, what to do."""

from __future__ import annotations

import importlib.util
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import click
from rich.markup import escape

from sysid_ros import __version__
from sysid_ros.cli import options as opt
from sysid_ros.cli.output import check_outputs, report, table, write_json
from sysid_ros.cli.progress import said_if_slow
from sysid_ros.exceptions import SysidError

_PARTS = (
    ("pinocchio", "pin", "rigid bodies; needed", "pip install pin"),
    ("numba", "numba", "compiled code; needed", "pip install numba"),
    ("rosbags", "rosbags", "bags; needed", "pip install rosbags"),
    ("cvxpy", "cvxpy", "physical consistency; needed", "pip install cvxpy"),
    ("rclpy", "ros-jazzy-rclpy", "the nodes", "pip install 'sysid_ros[ros]', or source /opt/ros/jazzy/setup.bash"),
    ("pybullet", "pybullet", "sysid simulate, control", "pip install 'sysid_ros[sim]'"),
    ("mujoco", "mujoco", "MJCF; gain in simulation of diagnose", "pip install 'sysid_ros[mujoco]'"),
    ("pyarrow", "pyarrow", "Parquet tables", "pip install 'sysid_ros[tables]'"),
    ("xacro", "xacro", "robots written as xacro", "pip install 'sysid_ros[xacro]'"),
    ("rerun", "rerun-sdk", "recordings for the viewer of Rerun", "pip install 'sysid_ros[rerun]'"),
)
"""Module, distribution, what it brings, and how to get it."""

_URDF = """<robot name="two"><link name="base"/><link name="one"><inertial><origin xyz="0 0 0.2"/><mass value="2"/>
<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link><link name="two"><inertial>
<origin xyz="0 0 0.1"/><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.005"/></inertial></link>
<joint name="a" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="50"
velocity="3"/></joint><joint name="b" type="revolute"><origin xyz="0 0 0.4"/><parent link="one"/><child link="two"/><axis
xyz="0 1 0"/><limit lower="-2" upper="2" effort="50" velocity="3"/></joint></robot>"""


@click.command()
@opt.JSON
@opt.FORCE
def command(json_path: Path | None, force: bool) -> int:
    """Tell what is installed, try what must work, and say what to do about what does not.

    \b
    Example:
      sysid doctor

    Exit codes: 0 all that is needed works; 1 something that is needed does not.
    """
    check_outputs(force, json=json_path)
    parts = [_part(*part) for part in _PARTS]
    tried = [_tried(what, attempt) for what, attempt in _ATTEMPTS.items()]
    console = report()
    console.print(f"sysid_ros {__version__}, Python {platform.python_version()}, {platform.platform()}, {os.cpu_count()} cores")
    shown = table("Installed", "part", "version", "brings", words=["brings"])
    for name, version, brings, _ in parts:
        shown.add_row(name, version or "-", brings)
    console.print(shown)
    shown = table("Tried", "what", "works", "", words=[""])
    for what, trouble, said in tried:
        shown.add_row(what, "NO" if trouble else "yes", escape(trouble or said))
    console.print(shown)
    todo = [f"{brings}: {cure}" for _, version, brings, cure in parts if version is None]
    for sentence in todo:
        console.print(f"- For {escape(sentence)}")
    missing = [name for name, version, brings, _ in parts if version is None and "needed" in brings]
    bad = [what for what, trouble, _ in tried if trouble] + missing
    console.print("Something that is needed does not work; see above." if bad else "What is needed works.")
    if json_path:
        installed = {name: version for name, version, *_ in parts}
        write_json(json_path, {"installed": installed, "tried": {what: trouble or None for what, trouble, _ in tried}})
    return 1 if bad else 0


def _part(module: str, distribution: str, brings: str, cure: str) -> tuple[str, str | None, str, str]:
    if importlib.util.find_spec(module) is None:
        return module, None, brings, cure
    try:
        return module, metadata.version(distribution), brings, cure
    except metadata.PackageNotFoundError:
        return module, "without a version", brings, cure


def _tried(what: str, attempt: Callable[[], str]) -> tuple[str, str, str]:
    """What was tried, what is wrong, and what it says if nothing is."""
    try:
        return what, "", attempt()
    except (SysidError, ImportError, OSError, RuntimeError, ValueError) as error:
        return what, f"{type(error).__name__}: {error}", ""


def _estimation() -> str:
    from sysid_ros.online.warm_up import warm_up
    from sysid_ros.online_settings import OnlineSettings
    from sysid_ros.robot.robot_model import RobotModel

    started = time.monotonic()
    with said_if_slow("Loading compiled code; after an install it is compiled, which takes a minute, once"):
        estimates = warm_up(RobotModel.from_urdf(_URDF), OnlineSettings())
    if not estimates:
        raise RuntimeError("it gives no estimate")
    return f"{estimates} estimates in {time.monotonic() - started:.1f} s, what was compiled or loaded included"


def _cache() -> str:
    folder = Path(os.environ.get("NUMBA_CACHE_DIR", "") or Path(__file__).parent / "__pycache__")
    writable = os.access(folder if folder.is_dir() else folder.parent, os.W_OK)
    where = folder if writable else "numba's folder for users: the package's own can't be written to"
    return f"in {where}"


def _written() -> str:
    with tempfile.NamedTemporaryFile(dir=Path.cwd()) as file:
        file.write(b"x")
    return f"in {Path.cwd()}"


def _picture() -> str:
    from matplotlib.figure import Figure

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.png"
        Figure().savefig(path)
        return f"{path.stat().st_size} bytes"


def _python() -> str:
    if not (3, 11) <= sys.version_info[:2] <= (3, 13):
        raise RuntimeError(f"Python {platform.python_version()} was not tried; 3.11 to 3.13 were")
    return "3.11 to 3.13 were tried"


_ATTEMPTS: dict[str, Callable[[], str]] = {
    "version of Python": _python,
    "estimation": _estimation,
    "compiled code is kept": _cache,
    "pictures": _picture,
    "files here": _written,
}
