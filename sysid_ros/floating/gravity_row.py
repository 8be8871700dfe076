"""Rows of a robot on legs: GravityRow, what its accelerometer must show; StandingColumns, at rest its columns are constant."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.causal_filters import LowPassBank


class GravityRow:
    """One more row of the equation, which knows nothing of masses and so tells the accelerometer's bias b from a load::

        s + b - (dv/dt + w x v) = g u + b,       | g u + b | = g + u' b

    with s the specific force, v and w the velocity and the angular velocity of the trunk in its own axes, u the vertical. The
    feet that stand tell v, each by its share of the load: ``0 = v + w x p + J_l v_l`` at each point p where one touches. The
    derivative of v is that of the low-passed v, so its error has no mean however often feet change (Bloesch et al. 2013 fuse the
    same measurements in a filter).

    Args:
        gravity: at the place [m/s^2]. cutoff_hz, rate: of the low-pass [Hz]. period: between rows [s].
    """

    def __init__(self, gravity: float, cutoff_hz: float, rate: float, period: float) -> None:
        self._gravity, self._period = gravity, period
        self._raw = np.zeros((2, 3))
        self._bank = LowPassBank(self._raw.shape, cutoff_hz, rate)
        self._before: FloatArray | None = None

    def push(self, sample: Sample, points: FloatArray, load: FloatArray) -> None:
        """Take in a sample, with the Jacobians (k, 3, n) of the points that touch and the force on each, shape (k,)."""
        _observe(sample.v, sample.a, points, load, self._raw)
        self._bank.push(self._raw)

    def row(self) -> tuple[FloatArray, float]:
        """u, shape (3,), and ``u' b`` [m/s^2], of the time since the row before."""
        now = self._bank.output.copy()
        before, self._before = self._before, now
        if before is None:
            before = now
        gravity = 0.5 * (now[0] + before[0]) - (now[1] - before[1]) / self._period
        size = float(np.linalg.norm(gravity))
        return gravity / max(size, 1e-9), size - self._gravity


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _observe(v: FloatArray, a: FloatArray, points: FloatArray, load: FloatArray, out: FloatArray) -> None:
    """``s - w x v`` and ``v`` into the rows of ``out``; without a foot on the ground v stays as it was."""
    total = 0.0
    for i in range(load.size):
        total += max(load[i], 0.0)
    if total > 0.0:
        out[1] = 0.0
        for i in range(load.size):
            share = max(load[i], 0.0) / total
            if share > 0.0:
                for c in range(3):
                    for j in range(v.size):
                        out[1, c] -= share * points[i, c, j] * v[j]
    w, velocity = v[3:6], out[1]
    out[0, 0] = a[0] - (w[1] * velocity[2] - w[2] * velocity[1])
    out[0, 1] = a[1] - (w[2] * velocity[0] - w[0] * velocity[2])
    out[0, 2] = a[2] - (w[0] * velocity[1] - w[1] * velocity[0])


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
