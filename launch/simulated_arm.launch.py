"""Start a simulated arm that picks up a payload, and the estimator that finds it.

Example: ros2 launch sysid_ros simulated_arm.launch.py payload_mass:=2.0 pick_time:=8.0

Every parameter of the nodes is an argument: ros2 launch sysid_ros simulated_arm.launch.py --show-args
"""

from launch import LaunchDescription
from sysid_ros.nodes.launching import describe


def generate_launch_description() -> LaunchDescription:
    return describe(__file__)
