"""robot_of_source: the model of the joints that a recording is about."""

from __future__ import annotations

from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.flange import gripper_joints
from sysid_ros.robot.joint_choice import choose, renamed
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.urdf import read_urdf
from sysid_ros.sources.bag import BagSource
from sysid_ros.sources.table import TableSource

Source = BagSource | TableSource


def robot_of_source(source: Source, urdf: str, settings: OnlineSettings) -> tuple[Source, RobotModel]:
    """The source with the URDF's names for its joints, and the model in which those move that it is about.

    They are ``settings.joint_names``, joints of the messages: by the URDF's names, or by others, then the URDF's joints in its
    order. Else those that the messages name, but for joints of a gripper that come by themselves.

    Raises:
        RobotModelError: messages and URDF have no joint in common, or lack one of ``joint_names``.
        DataError: a table without names has another number of joints.
    """
    wanted = settings.joint_names
    if isinstance(source, TableSource):
        source = source.named(wanted or RobotModel.from_urdf(urdf).joint_names)
    if wanted:
        names = renamed(urdf, wanted, source.joint_names)
        if names:
            source = source.renamed(names)
            wanted = tuple(names.values())
    elif isinstance(source, BagSource):
        types, mimic, _ = read_urdf(urdf)
        wanted = choose([name for name in types if name not in mimic], gripper_joints(urdf), source.kinds)
    return source, RobotModel.for_messages(urdf, source.joint_names, wanted, settings.gravity)
