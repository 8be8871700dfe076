"""Which of several URDFs is that of the robot that was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sysid_ros.diagnosis.result import Diagnosis, RankedUrdf
from sysid_ros.diagnosis.robot_hypotheses import judge, rank
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
    return [RankedUrdf(name, float(p)) for name, p in zip(names, rank(found), strict=True)]


def with_ranking(found: Diagnosis, ranked: Sequence[RankedUrdf]) -> Diagnosis:
    """A diagnosis that says which of several URDFs it is of; the same where there was no choice."""
    if not ranked:
        return found
    best = max(ranked, key=lambda x: x.probability)
    parts = ", ".join(f"{x.urdf} {100.0 * x.probability:.3g} %" for x in ranked)
    sentence = f"Of the URDFs that were given, {best.urdf} is likeliest the robot's ({parts}): it is the one that was judged."
    refusal = f"{sentence} {found.refusal}" if found.refusal else None
    return replace(found, urdfs=tuple(ranked), refusal=refusal, notes=(sentence, *found.notes))
