"""Start the adaptive controller of an arm, and the payload estimator that it listens to.

Example: ros2 launch sysid_ros adaptive_controller.launch.py effort_commands:=/forward_effort_controller/commands
All in simulation: ros2 launch sysid_ros adaptive_controller.launch.py simulated:=true autostart:=true rate:=500

The controller sends no effort before it is active: ros2 lifecycle set /adaptive_controller configure, then activate
Every parameter of the nodes is an argument: ros2 launch sysid_ros adaptive_controller.launch.py --show-args
"""

from launch import LaunchDescription
from sysid_ros.nodes.launching import describe


def generate_launch_description() -> LaunchDescription:
    return describe(__file__)
