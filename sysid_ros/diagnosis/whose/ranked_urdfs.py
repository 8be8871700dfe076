"""Which of several URDFs is that of the robot that was recorded."""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.diagnosis.result import RankedUrdf
from sysid_ros.diagnosis.whose.robot_hypotheses import judge
from sysid_ros.diagnosis.whose.robot_likelihood import likeliest, probabilities
from sysid_ros.exceptions import DataError
from sysid_ros.input_gate.message_faults import in_order
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording


def rank_urdfs(robots: Sequence[RobotModel], names: Sequence[str], recordings: Sequence[Recording]) -> list[RankedUrdf]:
    """Probability that each of several URDFs with the same joints is that of the robot that was recorded, in their order.

    Raises:
        DataError: nothing of the recordings can be used, or the URDFs have different joints.
    """
    if len({robot.joint_names for robot in robots}) > 1:
        raise DataError("the URDFs name their joints differently: only those with the joints of the recordings can be compared.")
    ordered = [in_order(r)[0] for r in recordings]
    found = [x for robot in robots if (x := judge(robot, ordered)) is not None]
    if len(found) < len(robots):
        raise DataError(
            "the recordings hold no motion by which URDFs could be compared. Record 15 to 30 s in which every joint moves."
        )
    share = probabilities([likeliest(x.urdf) for x in found])
    return [RankedUrdf(name, float(p)) for name, p in zip(names, share, strict=True)]
