"""KnownShare: how much of what the arm itself costs shows in its efforts."""

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
    """

    def __init__(self, n: int, period: float, memory: float) -> None:
        self._moments, self._count, self._memory, self._period = np.zeros((5, n)), 0, memory, period

    def add(self, torque: FloatArray, left: FloatArray) -> None:
        """Take in a row: measured torque, and what is left of it beside what is known, shape (n,) each [N m]; no absurd one."""
        if not np.abs(torque).max() + np.abs(left).max() < _ABSURD:
            return
        self._count += 1
        _moments(torque, left, max(1.0 / self._count, 1.0 / self._memory), self._moments)

    def verdict(self) -> str:
        """A sentence where less than half shows, else an empty string."""
        if self._count < _FEWEST:
            return ""
        known, torque, both, squared, whole = self._moments
        varies, together, moves = squared - known**2, both - known * torque, whole - torque**2
        size = float(varies.sum())
        if not size > 0.0:
            return ""
        share = float(together.sum()) / size
        rest = np.maximum(moves - 2.0 * share * together + share**2 * varies, 0.0)
        rows = min(self._count, self._memory) * self._period / _ALONE
        std = math.sqrt(float(varies @ rest) / rows) / size
        if not 0.5 - share > _SURE * std**2:
            return ""
        return (
            f"The efforts show only {100.0 * max(share, 0.0):.0f} % (std {100.0 * std:.0f}) of the torque that the arm itself "
            "takes: are they compensated for gravity by the driver (effort_type), or in another unit (effort_scale)? The payload "
            "can't be trusted."
        )


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _moments(torque: FloatArray, left: FloatArray, rate: float, moments: FloatArray) -> None:
    """Means of k, tau, k tau, k^2 and tau^2, rows of ``moments`` (5, n), go on by a row."""
    for i in range(torque.size):
        known = torque[i] - left[i]
        moments[0, i] += rate * (known - moments[0, i])
        moments[1, i] += rate * (torque[i] - moments[1, i])
        moments[2, i] += rate * (known * torque[i] - moments[2, i])
        moments[3, i] += rate * (known * known - moments[3, i])
        moments[4, i] += rate * (torque[i] * torque[i] - moments[4, i])
