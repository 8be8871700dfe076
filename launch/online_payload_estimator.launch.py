"""Start the payload estimator of a robot that publishes joint_states.

Example: ros2 launch sysid_ros online_payload_estimator.launch.py urdf_path:=/path/robot.urdf model_path:=/path/model.yaml

Every parameter of the node is an argument: ros2 launch sysid_ros online_payload_estimator.launch.py --show-args
"""

from launch import LaunchDescription
from sysid_ros.nodes.launching import describe


def generate_launch_description() -> LaunchDescription:
    return describe(__file__)
