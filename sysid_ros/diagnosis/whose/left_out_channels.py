"""Faults of the channels against data that were left out: undone wrongly they predict other motion worse than a bare model."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from sysid_ros.diagnosis.channel_faults import Fault
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut, plain_terms
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import SCALES, Prepared
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.recording import Recording


def refuted_elsewhere(
    robot: RobotModel,
    faults: Sequence[Fault],
    fit: Fit,
    held: HeldOut,
    prepared: Callable[[Sequence[Recording]], Prepared],
    recordings: tuple[Sequence[Recording], Sequence[Recording]],
) -> list[Fault]:
    """Faults of signs and order with which all that was found predicts the channels that they concern worse than friction and
    offset alone predict them as they were published.

    Joints that move together have the same sign of velocity at any time: that one of them has a coarse encoder makes the other's
    the better one for its friction, and only another motion says whose it is. Factors are no such faults: the data that were
    fitted tell them with a deviation.

    Args:
        fit, held: with all faults undone, and what it is judged on. prepared: rows of recordings. recordings: fitted, left out,
            as they were published.
    """
    asked = [f for f in faults if not f.effect.absorbs]
    if not asked:
        return []
    joints = sorted({j for f in asked for j in f.joints})
    train, there = (prepared(x) for x in recordings)
    library, train.problem.scale = Library(robot, train.band), SCALES[0]
    bare = train.problem.fit([t for j in train.problem.active for t in plain_terms(library, int(j))])
    left_out = HeldOut.of(robot, there, bare)
    rows = held.residual(fit)
    for fault in reversed(faults):
        rows = fault.effect.publish(rows)
    ratio = held.rms(rows)[joints] / np.maximum(left_out.rms(left_out.residual(bare))[joints], 1e-12)
    return asked if float(np.mean(ratio**2)) > 1.0 else []
