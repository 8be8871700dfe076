"""GravityRow: what the accelerometer of a robot on legs shows beside its motion over the feet must be gravity."""

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
