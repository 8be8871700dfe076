"""What is never known of a joint: how its friction turns at a reversal or differs with direction, its torque gain, and by how
much its drive is slower than others; columns with a prior beside the causes of every set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import SLIDE, smoothed_sign, smoothed_sign_slope
from sysid_ros.sample import FloatArray

_BUMPS = {0.015: 0.5, 0.05: 0.05}
"""Part by which dry friction may be more or less below a speed [rad/s], whatever its form."""
_EARLY = 0.002
"""Time by which the sign of a measured velocity turns early or late, and a drive is slower or quicker than others [s]."""
_WIDTHS = (0.005, 0.05)
"""Speeds at which that sign has turned [rad/s], of a hard and of a soft one."""
_ONE_WAY = 0.02
"""Part by which dry friction differs from one direction to the other."""
_OFFSET = 0.01
"""Part of its effort limit by which a joint's sensor is off where no offset was found: a spring that rests elsewhere is alike."""
_GAIN = 0.02
"""Part by which the torque constant of a joint is off, where the links are not exact either."""
_UNIT = float(np.log(3.0))
"""The same of a joint whose efforts are in a unit of its own: that the factor was found does not make it known."""
GAIN_AT = len(_BUMPS) + len(_WIDTHS) + 1
"""Which of the columns is that of the gain."""


def dry_friction(robot: RobotModel, fit: Fit) -> FloatArray:
    """Its level on each joint, the nominal model's and what a fit adds, shape (n,) [N m]."""
    level = robot.friction.copy()
    for term in fit.terms:
        level += term.effect.as_dry_friction(term.theta_of_effect(fit.theta_of(term)))
    return np.maximum(level, 0.0)


def unknown_columns(problem: Problem, dry: FloatArray, whole: bool = False) -> FloatArray:
    """Of each joint, shape (c, K, n); none where the problem considers what is never known itself.

    Args:
        dry: level of the dry friction on each joint, shape (n,) [N m].
        whole: all of them. While sets are compared the torque constant is one of what the links need, for what rubs may leave a
            set, and all drives are as quick.
    """
    if problem.considered:
        return np.zeros((0, *problem.y.shape))
    curves = []
    given = np.max([np.abs(m.drive_torque).max(axis=0) for m in problem.band.motions], axis=0)
    limit = problem.band.motions[0].robot.effort_limit
    largest = np.where(np.isfinite(limit) & (limit > 0.0), limit, given)
    for motion in problem.band.motions:
        unit = np.where(motion.robot.is_prismatic, SLIDE, 1.0)
        v, a = motion.v / unit, motion.a / unit
        bumps = [smoothed_sign(v, _WIDTHS[0]) * np.exp(-((v / speed) ** 2)) for speed in _BUMPS]
        turning = [smoothed_sign_slope(v, width) * a for width in _WIDTHS]
        rubs = [x * dry for x in (*bumps, *turning, np.ones_like(v))]
        of_drive = (motion.drive_torque, motion.rate_of(motion.drive_torque)) if whole else (motion.link_torque,)
        of_sensor = (np.broadcast_to(largest, v.shape),) if whole else ()
        curves.append(np.stack([*rubs, *of_drive, *of_sensor]))
    rows: FloatArray = problem.band.curves(curves)
    return rows


def unknown_prior(scale: float, whole: bool = False, level: bool = False, free: bool = False) -> FloatArray:
    """Inverse variances of their parameters before any data, shape (c,).

    Args:
        scale: how inexact the links are, in units of the usual inexactness; 0 for a simulation, in which all is exact. whole: as
            :func:`unknown_columns` has it. level: the joint's offset is known. free: its efforts are in a unit of their own.
    """
    gain, lag, offset = (_GAIN, _EARLY, 1e-6 if level else _OFFSET) if scale > 0.0 else (1e-6, 1e-6, 1e-6)
    rubs = [*_BUMPS.values(), *(_EARLY for _ in _WIDTHS), _ONE_WAY]
    return np.array([*rubs, _UNIT if free else gain, *([lag, offset] if whole else [])]) ** -2.0


def unknown_priors(joints: Sequence[int], scale: float, free: Sequence[int]) -> FloatArray:
    """:func:`unknown_prior` of each of some joints; ``free``: those whose efforts are in a unit of their own."""
    return np.concatenate([np.zeros(0), *(unknown_prior(scale, free=int(j) in free) for j in joints)])
