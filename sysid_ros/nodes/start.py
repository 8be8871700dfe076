"""Entry points of the nodes: they say what is missing before they import it."""

from __future__ import annotations

import importlib
import sys
from importlib.util import find_spec

_CURES = {
    "rclpy": "source /opt/ros/jazzy/setup.bash, or take the wheels: pip install 'sysid_ros[ros]'",
    "pybullet": "pip install 'sysid_ros[sim]'",
}
_BAD_INPUT = 2


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
    for package in needed:
        if find_spec(package) is None:
            sys.stderr.write(f"Error: {name} needs {package}, which is not installed: {_CURES[package]}.\n")
            return _BAD_INPUT
    code: int = importlib.import_module(f"sysid_ros.nodes.{name}").main()
    return code
