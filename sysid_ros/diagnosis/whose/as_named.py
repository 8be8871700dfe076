"""as_named: whether the channels of recordings are what they are named, before a model is identified from them.

What a fit is given it fits: a joint whose position counts backwards gives links that no body can be, or friction, with small
intervals and no word of doubt.
"""

from __future__ import annotations

from collections.abc import Sequence

from sysid_ros.diagnosis.channel_faults import Fault
from sysid_ros.diagnosis.legs.leg_channels import channels_on_legs
from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.first_choice import channel_is_likelier
from sysid_ros.diagnosis.whose.mount import mounted_otherwise
from sysid_ros.diagnosis.whose.robot_hypotheses import judge
from sysid_ros.diagnosis.whose.told_mount import otherwise
from sysid_ros.effects.wording import of_joints
from sysid_ros.exceptions import DataError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.identification.channel_checks import check_legs
from sysid_ros.identification.result import Problem
from sysid_ros.identification.spectrum import choose_cutoff
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording

_LIKELY = 0.5
"""Probability from which a fault of another kind than a unit is told."""


def as_named(
    robot: RobotModel,
    base: FloatingBase | None,
    recordings: Sequence[Recording],
    max_gap: float = 0.1,
    accept_doubts: bool = False,
) -> list[Problem]:
    """What is wrong with signs and order of the channels, and of a robot on legs with its IMU, where that is accepted.

    Args:
        robot: the model. base: of a robot on legs. recordings: to identify from. max_gap: a longer gap is not bridged [s].
        accept_doubts: go on regardless.

    Raises:
        DataError: something is and is not accepted; or the robot is mounted otherwise than gravity is set.
    """
    text = _of_arm(robot, recordings) if base is None else _of_legs(base, recordings, max_gap)
    if not text:
        return []
    if not accept_doubts:
        raise DataError(f"{text} --accept-doubts goes on regardless.")
    return [Problem("", "", "channels", text)]


def _of_arm(robot: RobotModel, recordings: Sequence[Recording]) -> str:
    """In words; empty where all is as it is named, or units alone are doubtful, which the fit itself judges."""
    rows = CoarseRows.of(robot, recordings)
    if rows is None or (mounted_otherwise(robot, rows) is None and not channel_is_likelier(robot, rows)):
        return ""
    found = judge(robot, recordings)
    if found is None:
        return ""
    if found.mount is not None:
        raise DataError(otherwise(robot, found.mount))
    likely = [f for f in found.faults if not f.effect.absorbs and (f.probability or 0.0) >= _LIKELY]
    return _in_words(likely, robot.joint_names)


def _of_legs(base: FloatingBase, recordings: Sequence[Recording], max_gap: float) -> str:
    checked = [check_legs(base.legs, r, max_gap) for r in recordings]
    if any(c.recording.trunk is None for c in checked):
        return ""  # said by the identification itself
    cutoff = choose_cutoff(recordings, base.legs.joint_names, max_gap).hz
    found = channels_on_legs(base, checked, cutoff, max_gap)
    return found.refusal or _in_words(found.faults, base.legs.joint_names)


def _in_words(faults: Sequence[Fault], joints: Sequence[str]) -> str:
    """What is wrong, its probability, and the cure; empty where nothing is."""
    if not faults:
        return ""
    each = [(f, of_joints([joints[j] for j in f.joints], len(joints))) for f in faults]
    said = "; ".join(f"{f.effect.label} ({f.effect.id}, {where}, probability {f.probability:.3g})" for f, where in each)
    return (
        f"The channels are not what they are named: {said}. Correct it in the driver, or in --config; 'sysid diagnose' undoes "
        "it, and tells what else is wrong."
    )
