"""Start an arm in ros2_control, and the adaptive controller with the payload estimator that move it by efforts.

Example: ros2 launch sysid_ros ros2_control_arm.launch.py
With a robot of your own: urdf_path:=/path/robot.urdf controllers:=/path/controllers.yaml joint_names:='[joint_1, joint_2]'

The controller sends no effort before it is active: ros2 lifecycle set /adaptive_controller configure, then activate
Every parameter of the nodes is an argument: ros2 launch sysid_ros ros2_control_arm.launch.py --show-args
"""

from launch import LaunchDescription
from sysid_ros.nodes.launching import describe


def generate_launch_description() -> LaunchDescription:
    return describe(__file__)
