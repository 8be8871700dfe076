"""What is never exactly known of a joint: how its friction turns at a reversal, or differs with direction, and its torque gain.

These are columns with a prior beside the causes of every set. No cause wins over another by what they can take, and what they
could have taken is in the intervals of the others; the model itself has none of them.
"""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.fit import Problem
from sysid_ros.robot.smoothed_sign import SLIDE, smoothed_sign, smoothed_sign_slope
from sysid_ros.sample import FloatArray

_BUMPS = {0.015: 0.5, 0.05: 0.05}
"""Part by which dry friction may be more or less below a speed [rad/s], whatever its form."""
_EARLY = 0.002
"""Time by which the sign of a measured velocity turns early or late [s]."""
_WIDTHS = (0.005, 0.05)
"""Speeds at which that sign has turned [rad/s], of a hard and of a soft one."""
_ONE_WAY = 0.02
"""Part by which dry friction differs from one direction to the other."""
_GAIN = 0.02
"""Part by which the torque constant of a joint is off, where the links are not exact either."""


def columns(problem: Problem, dry: FloatArray, whole: bool = False) -> FloatArray:
    """Of each joint, shape (c, K, n).

    Args:
        dry: level of the dry friction on each joint, shape (n,) [N m].
        whole: the torque constant is one of all that the drives give, as far as that is known, else of what the links need: while
            sets are compared what rubs may leave one.
    """
    curves = []
    for motion in problem.band.motions:
        unit = np.where(motion.robot.is_prismatic, SLIDE, 1.0)
        v, a = motion.v / unit, motion.a / unit
        bumps = [smoothed_sign(v, _WIDTHS[0]) * np.exp(-((v / speed) ** 2)) for speed in _BUMPS]
        turning = [smoothed_sign_slope(v, width) * a for width in _WIDTHS]
        rubs = (*bumps, *turning, np.ones_like(v))
        curves.append(np.stack([*(x * dry for x in rubs), motion.drive_torque if whole else motion.link_torque]))
    rows: FloatArray = problem.band.curves(curves)
    return rows


def prior(scale: float) -> FloatArray:
    """Inverse variances of their parameters before any data, shape (c,).

    Args:
        scale: how inexact the links are, in units of the usual inexactness; 0 for a simulation, in which all is exact.
    """
    gain = _GAIN if scale > 0.0 else 1e-6
    return np.array([*_BUMPS.values(), *(_EARLY for _ in _WIDTHS), _ONE_WAY, gain]) ** -2.0
