"""The launch files under launch_testing, with real processes; skipped where ROS 2's launch is not installed."""

from __future__ import annotations

import time
import unittest
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("launch_testing", reason="launch_testing is not installed: it comes with ROS 2")
pytest.importorskip("launch_ros.actions", reason="launch_ros is not installed: it comes with ROS 2, not from PyPI")
pytest.importorskip("ament_index_python", reason="ament_index_python is not installed")
pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install '.[sim]'")

import launch_testing
import launch_testing.asserts
import rclpy
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from geometry_msgs.msg import InertiaStamped
from launch.actions import IncludeLaunchDescription, TimerAction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_testing.actions import ReadyToTest

from launch import LaunchDescription

try:
    SHARE = Path(get_package_share_directory("sysid_ros"))
except PackageNotFoundError:
    pytest.skip("build sysid_ros with colcon and source install/setup.bash", allow_module_level=True)

PAYLOAD = "/left/online_payload_estimator/payload"
TRUTH = 1.2


@pytest.mark.launch_test
def generate_test_description() -> LaunchDescription:
    given = {"namespace": "left", "payload_mass": str(TRUTH), "pick_time": "5.0", "rate": "250"}
    included = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(SHARE / "launch" / "simulated_arm.launch.py")), launch_arguments=given.items()
    )
    return LaunchDescription([included, TimerAction(period=1.0, actions=[ReadyToTest()])])


class TestTheSimulatedArm(unittest.TestCase):
    def test_the_payload_is_found_in_the_namespace(self) -> None:
        rclpy.init()
        node = rclpy.create_node("ear")
        masses: list[float] = []
        try:
            node.create_subscription(InertiaStamped, PAYLOAD, lambda message: masses.append(message.inertia.m), 10)
            # the first start on a machine compiles
            end = time.monotonic() + 180.0
            while time.monotonic() < end and not (masses and abs(masses[-1] - TRUTH) < 0.05 * TRUTH):
                rclpy.spin_once(node, timeout_sec=0.1)
        finally:
            node.destroy_node()
            rclpy.try_shutdown()
        assert masses, f"nothing came on {PAYLOAD}"
        assert abs(masses[-1] - TRUTH) < 0.05 * TRUTH


@launch_testing.post_shutdown_test()
class TestTheEnd(unittest.TestCase):
    def test_every_process_ends_cleanly(self, proc_info: Any) -> None:
        launch_testing.asserts.assertExitCodes(proc_info)

    def test_nothing_prints_a_stack(self, proc_output: Any) -> None:
        for process in proc_output.processes():
            for piece in proc_output[process]:
                assert b"Traceback" not in piece.text
