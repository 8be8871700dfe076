"""KnownShare: how much of what the arm itself costs shows in its efforts; average_row: the means by which a model is checked."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_ALONE = 0.5
"""After so long a row is another one: about what it takes an arm to get elsewhere [s]."""
_SURE = math.log(1000.0)
"""Logarithm of how much likelier it must be that nothing of it shows than that all does, which is the rule."""
_ABSURD = 1e12
"""No torque [N m]."""
_FEWEST = 200
"""Rows that it takes."""


class KnownShare:
    """Efforts are ``tau = x k + e`` with the torque k that links and friction, as they are known, ask for. x is near 1 of efforts
    that are torques, whatever is carried, and near 0 of those without what the arm weighs by itself, as after a driver that
    compensates gravity, or in another unit. Of x, known to s, 0 is likelier than 1 by ``(1/2 - x) / s^2`` (logarithm). Joints
    count by their torques, most of which is gravity; means do not count, as an offset is none of either.

    Args:
        n: joints. period: between rows [s]. memory: time constant of the averages [rows].

    Attributes:
        moments: means of k, tau, k tau, k^2 and tau^2, shape (5, n), which :func:`average_row` writes.
    """

    def __init__(self, n: int, period: float, memory: float) -> None:
        self.moments, self._memory, self._period = np.zeros((5, n)), memory, period

    def verdict(self, count: int) -> str:
        """A sentence where nothing of it shows, by so many rows, else an empty string."""
        if count < _FEWEST:
            return ""
        known, torque, both, squared, whole = self.moments
        varies, together, moves = squared - known**2, both - known * torque, whole - torque**2
        size = float(varies.sum())
        if not size > 0.0:
            return ""
        share = float(together.sum()) / size
        rest = np.maximum(moves - 2.0 * share * together + share**2 * varies, 0.0)
        rows = min(count, self._memory) * self._period / _ALONE
        std = math.sqrt(float(varies @ rest) / rows) / size
        if not 0.5 - share > _SURE * std**2:
            return ""
        return (
            f"The efforts show only {100.0 * max(share, 0.0):.0f} % (std {100.0 * std:.0f}) of the torque that the arm itself "
            "takes: are they compensated for gravity by the driver (effort_type), or in another unit (effort_scale)? The payload "
            "can't be trusted."
        )


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def average_row(
    torque: FloatArray,
    Y: FloatArray,
    y: FloatArray,
    theta: FloatArray,
    rate: float,
    whole: FloatArray,
    unexplained: FloatArray,
    moments: FloatArray,
) -> None:
    """Means of the squared torque and of the square of what ``Y theta`` leaves of y, shape (n,) each, go on by a row, and the
    ``moments`` of :class:`.KnownShare`, shape (5, n) or of none."""
    for i in range(whole.size):
        left = y[i]
        for k in range(theta.size):
            left -= Y[i, k] * theta[k]
        whole[i] += rate * (torque[i] * torque[i] - whole[i])
        unexplained[i] += rate * (left * left - unexplained[i])
    for i in range(moments.shape[1]):
        measured, known = torque[i], torque[i] - y[i]
        if not abs(measured) + abs(known) < _ABSURD:
            continue
        moments[0, i] += rate * (known - moments[0, i])
        moments[1, i] += rate * (measured - moments[1, i])
        moments[2, i] += rate * (known * measured - moments[2, i])
        moments[3, i] += rate * (known * known - moments[3, i])
        moments[4, i] += rate * (measured * measured - moments[4, i])
