"""The demo's child processes: started in a group of their own, always stopped, their log kept."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

import sysid_ros
from sysid_ros.exceptions import SysidError

_SOFT_STOP = 5.0
_LINES = 15
_WRITE_URDF = """
import pathlib, sys
from sysid_ros.simulation.description import {robot}_description
pathlib.Path(sys.argv[1]).write_text({robot}_description())
"""


class ProcessFailed(SysidError):
    """A process of the demo ended or said nothing; the message holds the end of its log."""


class DemoProcess:
    """One ROS 2 node in a process group of its own, within ``with``.

    Args:
        module: run by ``python -m``. parameters: of the node. environment: of the process.
        log: file that stdout and stderr go to.
    """

    def __init__(self, module: str, parameters: dict[str, object], environment: Mapping[str, str], log: Path) -> None:
        self.name = module.rpartition(".")[2]
        self.log = log
        self._command = [sys.executable, "-m", module, *ros_arguments(parameters)]
        self._environment = child_environment(environment)
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> DemoProcess:
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self._environment,
                start_new_session=True,
            )
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        process = self._process
        if process is None:
            return
        for sign, patience in ((signal.SIGINT, _SOFT_STOP), (signal.SIGKILL, None)):
            try:
                os.killpg(process.pid, sign)
            except ProcessLookupError:
                break
            try:
                process.wait(patience)
                break
            except subprocess.TimeoutExpired:
                continue
        process.wait()

    def check(self) -> None:
        """Raises :class:`ProcessFailed` where the process has ended by itself."""
        assert self._process is not None
        code = self._process.poll()
        if code is not None:
            raise ProcessFailed(f"The process {self.name} ended with code {code}. {self.last_words()}")

    def last_words(self) -> str:
        """The end of its log, for a message."""
        lines = self.log.read_text(errors="replace").splitlines()[-_LINES:]
        return f"Its log ({self.log}) ends with:\n" + "\n".join(f"    {line}" for line in lines or ["(it is empty)"])


def write_urdf(path: Path, robot: str) -> None:
    """Write the URDF of the simulated robot, "arm" or "quadruped"; in another process, because PyBullet writes to stdout when it
    is imported.

    Raises:
        ProcessFailed: it could not be written.
    """
    command = [sys.executable, "-c", _WRITE_URDF.format(robot=robot), str(path)]
    done = subprocess.run(command, env=child_environment(os.environ), capture_output=True, text=True, check=False)
    if done.returncode:
        raise ProcessFailed(f"The simulated robot's URDF could not be written to {path}:\n{done.stderr}")


def child_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """The same with this package on the path, so that a child finds it where it is not installed."""
    root = str(Path(sysid_ros.__file__).resolve().parents[1])
    return {**environment, "PYTHONPATH": os.pathsep.join(filter(None, (root, environment.get("PYTHONPATH"))))}


def ros_arguments(parameters: dict[str, object]) -> list[str]:
    """Command-line arguments that set a node's parameters."""
    if not parameters:
        return []
    return ["--ros-args", *(word for name, value in parameters.items() for word in ("-p", f"{name}:={_yaml(value)}"))]


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(_yaml(x) for x in value) + "]"
    return str(value)
