"""Entry points of the nodes: their help, and what is missing, before anything of ROS is imported."""

from __future__ import annotations

import importlib
import os
import signal
import sys
from importlib.util import find_spec
from pathlib import Path

from sysid_ros import __version__

_CURES = {
    "rclpy": "source /opt/ros/jazzy/setup.bash, or take the wheels: pip install 'sysid_ros[ros]'",
    "pybullet": "pip install 'sysid_ros[sim]'",
}
_EXAMPLES = {
    "online_payload_estimator": "-p urdf_path:=arm.urdf -p model_path:=model.yaml -r joint_states:=/arm/joint_states",
    "adaptive_controller": "-p urdf_path:=arm.urdf -p model_path:=model.yaml",
    "simulated_robot": "-p payload_mass:=1.5 -p pick_time:=8.0 -p drop_time:=20.0",
}
_HELP = """Usage: {name} [--ros-args [-p PARAMETER:=VALUE]... [-r NAME:=NAME]... [--params-file YAML]]

A ROS 2 node, started by itself or as 'ros2 run sysid_ros {name}'; Ctrl-C stops it.
Its parameters, with what each means: {config}

Options:
  -h, --help  this text
  --version   the version of sysid_ros

Example:
  {name} --ros-args {example}
"""
_BAD_INPUT, _INTERRUPTED = 2, 130


def online_payload_estimator() -> int:
    """``ros2 run sysid_ros online_payload_estimator``."""
    return _run("online_payload_estimator", "rclpy")


def adaptive_controller() -> int:
    """``ros2 run sysid_ros adaptive_controller``."""
    return _run("adaptive_controller", "rclpy")


def simulated_robot() -> int:
    """``ros2 run sysid_ros simulated_robot``."""
    return _run("simulated_robot", "rclpy", "pybullet")


def _run(name: str, *needed: str) -> int:
    if {"-h", "--help"} & set(sys.argv[1:]):
        sys.stdout.write(_HELP.format(name=name, example=_EXAMPLES[name], config=_configuration(name)))
        return 0
    if "--version" in sys.argv[1:]:
        sys.stdout.write(f"{name} (sysid_ros) {__version__}\n")
        return 0
    # nothing runs yet: while the libraries load there is nothing to clean up, and no stack of theirs helps anybody
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(_INTERRUPTED))
    for package in needed:
        if find_spec(package) is None:
            sys.stderr.write(f"Error: {name} needs {package}, which is not installed: {_CURES[package]}.\n")
            return _BAD_INPUT
    code: int = importlib.import_module(f"sysid_ros.nodes.{name}").main()
    return code


def _configuration(name: str) -> str:
    """Where the annotated configuration of a node lies: in the source, else where it was installed to, else its name."""
    here = Path(__file__).resolve()
    folders = (here.parents[2] / "config", *(p / "share" / "sysid_ros" / "config" for p in here.parents))
    found = next((path for folder in folders if (path := folder / f"{name}.yaml").is_file()), None)
    return str(found or f"share/sysid_ros/config/{name}.yaml")
