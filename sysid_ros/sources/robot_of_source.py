"""robot_of_source: the model of the joints that a recording is about."""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.exceptions import RobotModelError
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
    if isinstance(source, BagSource) and not source.names_joints:
        source = _named(source, urdf, wanted)
    if isinstance(source, TableSource):
        source = source.named(wanted or RobotModel.from_urdf(urdf).joint_names)
    if wanted:
        names = renamed(urdf, wanted, source.joint_names)
        if names:
            source = source.renamed(names)
            wanted = tuple(names.values())
    elif isinstance(source, BagSource) and source.names_joints:
        types, mimic, _ = read_urdf(urdf)
        wanted = choose([name for name in types if name not in mimic], gripper_joints(urdf), source.kinds)
    return source, RobotModel.for_messages(urdf, source.joint_names, wanted, settings.gravity)


def _named(source: BagSource, urdf: str, joint_names: Sequence[str]) -> BagSource:
    """Messages that name no joints, with the URDF's names in its order."""
    types, mimic, _ = read_urdf(urdf)
    grips = gripper_joints(urdf)
    joints = list(joint_names) or [name for name in types if name not in mimic and name not in grips]
    n = len(source.joint_names)
    if len(joints) != n:
        raise RobotModelError(
            f"bag '{source.path}': messages of {source.kind} hold {n} joints and no names; there are {len(joints)} to take them "
            f"for: {', '.join(joints)}. Say which {n} of the URDF they are with --joint-names."
        )
    return source.renamed(dict(zip(source.joint_names, joints, strict=True)))
