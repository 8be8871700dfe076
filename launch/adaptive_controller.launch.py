"""Start the adaptive controller of an arm, and the payload estimator that it listens to.

Example: ros2 launch sysid_ros adaptive_controller.launch.py effort_commands:=/forward_effort_controller/commands

The controller sends no effort before it is active: ros2 lifecycle set /adaptive_controller configure, then activate
"""

from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.substitutions import FindPackageShare

from launch import LaunchContext, LaunchDescription

ARGUMENTS = (
    ("urdf_path", "", "the robot's URDF; empty: from the topic robot_description"),
    ("model_path", "", "model.yaml of 'sysid identify'; empty: the URDF is what is known"),
    ("frame_id", "", "frame that the payload is fixed to; empty: the arm's flange"),
    ("law", "composite", "the control law"),
    ("autostart", "false", "configure and activate at the start: efforts are sent from the first state on"),
    ("joint_states", "joint_states", "topic of the joint states"),
    ("robot_description", "robot_description", "topic of the URDF"),
    ("effort_commands", "effort_commands", "topic that the robot takes its efforts from"),
)
ESTIMATOR = PathJoinSubstitution([FindPackageShare("sysid_ros"), "launch", "online_payload_estimator.launch.py"])
SHARED = ("urdf_path", "model_path", "frame_id", "joint_states", "robot_description")


def start(context: LaunchContext) -> list[LifecycleNode]:
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    topics = ("joint_states", "robot_description", "effort_commands")
    node = LifecycleNode(
        package="sysid_ros",
        executable="adaptive_controller",
        name="adaptive_controller",
        namespace="",
        parameters=[
            {name: value[name] for name in ("urdf_path", "model_path", "frame_id", "law")},
            {"autostart": value["autostart"].lower() == "true"},
        ],
        remappings=[(topic, value[topic]) for topic in topics if value[topic] != topic],
        output="screen",
    )
    return [node]


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=default, description=text) for name, default, text in ARGUMENTS]
    shared = {name: LaunchConfiguration(name) for name in SHARED}
    estimator = IncludeLaunchDescription(PythonLaunchDescriptionSource(ESTIMATOR), launch_arguments=shared.items())
    return LaunchDescription([*declared, OpaqueFunction(function=start), estimator])
