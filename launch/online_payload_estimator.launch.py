"""Start the payload estimator of an arm that publishes joint_states.

Example: ros2 launch sysid_ros online_payload_estimator.launch.py urdf_path:=/path/robot.urdf model_path:=/path/model.yaml
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.substitutions import FindPackageShare

from launch import LaunchContext, LaunchDescription

DEFAULT_CONFIG = PathJoinSubstitution([FindPackageShare("sysid_ros"), "config", "online_payload_estimator.yaml"])
ARGUMENTS = (
    ("urdf_path", "", "the robot's URDF; empty: from the topic robot_description"),
    ("model_path", "", "model.yaml of 'sysid identify'; empty: the URDF is what is known"),
    ("frame_id", "", "frame that the payload is expressed in; empty: the arm's flange"),
    ("config", DEFAULT_CONFIG, "parameters of the node"),
    ("namespace", "", "namespace of the node and its topics"),
    ("joint_states", "joint_states", "topic of the joint states"),
    ("robot_description", "robot_description", "topic of the URDF"),
    ("use_sim_time", "false", "time from /clock"),
)


def start(context: LaunchContext) -> list[LifecycleNode]:
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    # an argument that was not given must not hide what the configuration file says
    given = {name: value[name] for name in ("urdf_path", "model_path", "frame_id") if value[name]}
    node = LifecycleNode(
        package="sysid_ros",
        executable="online_payload_estimator",
        name="online_payload_estimator",
        namespace=value["namespace"],
        parameters=[value["config"], given | {"use_sim_time": value["use_sim_time"].lower() == "true"}],
        remappings=[(topic, value[topic]) for topic in ("joint_states", "robot_description") if value[topic] != topic],
        output="screen",
    )
    return [node]


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=default, description=text) for name, default, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
