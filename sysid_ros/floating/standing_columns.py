"""StandingColumns: at rest the columns of the equation are constant, and noise in them must not look like motion."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray

_STANDS = 0.15
"""Time below the standstill velocity after which the robot stands [s]."""


class StandingColumns:
    """Replaces the columns by their mean since the robot stands.

    Noise in the measured accelerations makes the columns of each row a little different, which pretends an excitation that is
    not there, and least squares on them tends to zero. The mean over m rows has an m-th of the noise's variance, so that m rows
    of it add next to no information in directions that rest does not determine.

    Args:
        period: between rows [s]. velocity: below it on every joint and turn the robot stands [rad/s].
    """

    def __init__(self, period: float, velocity: float) -> None:
        self._period, self._velocity = period, velocity
        self._still = 0.0
        self._count = 0
        self._mean: FloatArray = np.zeros((0, 0))

    def push(self, columns: FloatArray, speed: FloatArray, whole: bool = True) -> FloatArray:
        """The columns (m, p) to use, given the velocities of the joints, shape (n,); ``whole`` is False where a part of what was
        measured is left out of them."""
        self._still = self._still + self._period if whole and float(speed.max()) < self._velocity else 0.0
        if self._still <= _STANDS:
            self._count = 0
            return columns
        self._count += 1
        self._mean = columns.copy() if self._count == 1 else self._mean + (columns - self._mean) / self._count
        return self._mean.copy()
