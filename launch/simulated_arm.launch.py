"""Start a simulated arm that picks up a payload, and the estimator that finds it.

Example: ros2 launch sysid_ros simulated_arm.launch.py payload_mass:=2.0 pick_time:=8.0
"""

from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchContext, LaunchDescription

NUMBERS = (
    ("payload_mass", "1.5", "[kg]"),
    ("pick_time", "10.0", "the payload is picked up so long after the start [s]; -1: only by ~/pick"),
    ("drop_time", "-1.0", "and dropped [s]; -1: only by ~/drop"),
)
ESTIMATOR = PathJoinSubstitution([FindPackageShare("sysid_ros"), "launch", "online_payload_estimator.launch.py"])


def start(context: LaunchContext) -> list[Node]:
    numbers = {name: float(LaunchConfiguration(name).perform(context)) for name, _, _ in NUMBERS}
    seed = int(LaunchConfiguration("seed").perform(context))
    robot = Node(package="sysid_ros", executable="simulated_robot", parameters=[numbers | {"seed": seed}], output="screen")
    return [robot]


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=default, description=text) for name, default, text in NUMBERS]
    declared.append(DeclareLaunchArgument("seed", default_value="0", description="seed of the motion and of the noise"))
    estimator = IncludeLaunchDescription(PythonLaunchDescriptionSource(ESTIMATOR))
    return LaunchDescription([*declared, OpaqueFunction(function=start), estimator])
