"""Periodicity of a motion: whole periods show what the noise is, and between their lines there is nothing but noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft, interpolate

from sysid_ros.frequency.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

_TREND = 4


@dataclass(frozen=True, slots=True)
class Periods:
    """A periodic part of a motion.

    Attributes:
        first: index where it begins. period: T [s]. count: whole periods in it.
    """

    first: int
    period: float
    count: int

    def cut(self, x: FloatArray, grid_period: float) -> FloatArray:
        """The periods of channels (N, ...) one by one, on M points each, shape (count, M, ...): what a Fourier series needs."""
        points = round(self.period / grid_period)
        span = int(np.ceil(self.count * self.period / grid_period)) + 2
        here = x[self.first : self.first + span]
        at = np.arange(self.count * points) * (self.period / points / grid_period)
        even = interpolate.CubicSpline(np.arange(len(here)), here, axis=0)(np.minimum(at, len(here) - 1.0))
        return np.asarray(even.reshape(self.count, points, *x.shape[1:]))


def find_periods(q: FloatArray, grid_period: float, moving: slice) -> Periods | None:
    """Whole periods of the positions (N, n) in the part where joints move; None where it does not repeat itself twice.

    Mean square difference of the motion from itself a lag later, over all joints, by correlation; its first deep minimum is the
    period, refined by a parabola. Where there are three periods or more the first is left to the transient.
    """
    x = q[moving] - q[moving].mean(axis=0)
    count = len(x)
    if count * grid_period < 2.0 * TOLERANCES.shortest_period:
        return None
    size = fft.next_fast_len(2 * count, real=True)
    correlation = fft.irfft(np.sum(np.abs(fft.rfft(x, size, axis=0)) ** 2, axis=1), size)[:count]
    power = np.concatenate([[0.0], np.cumsum(np.sum(x**2, axis=1))])
    lags = np.arange(count // 2 + 2)
    both = (power[count] - power[lags]) + power[count - lags]
    difference = np.maximum(both - 2.0 * correlation[lags], 0.0) / np.maximum(both, 1e-30)
    left = np.flatnonzero(difference > TOLERANCES.leaves)
    if not left.size:
        return None
    first = max(int(left[0]), int(TOLERANCES.shortest_period / grid_period))
    deep = np.flatnonzero(difference[first:] < TOLERANCES.repeats) + first
    if not deep.size:
        return None
    # up to where the valley rises again
    out_of = np.flatnonzero(difference[deep[0] :] > 2.0 * TOLERANCES.repeats)
    valley = slice(int(deep[0]), int(deep[0] + out_of[0]) if out_of.size else len(difference))
    best = valley.start + int(np.argmin(difference[valley]))
    lag = float(best)
    if 0 < best < len(difference) - 1:
        a, b, c = difference[best - 1 : best + 2]
        if a + c - 2.0 * b > 0.0:
            lag += 0.5 * (a - c) / (a + c - 2.0 * b)
    periods = int((count + 1.5) / lag)
    if periods < 2:
        return None
    skipped = 1 if periods > 2 else 0
    begin = moving.start + round(skipped * lag)
    return Periods(begin, lag * grid_period, periods - skipped)


def bridged(values: FloatArray, standing: FloatArray) -> FloatArray:
    """Channels (N, c) with straight lines over the rests of a joint, where dry friction leaves its torque undetermined.

    Args:
        standing: (first, end) of each rest, shape (r, 2).
    """
    out = values.copy()
    for a, b in standing.astype(int):
        if a > 0 and b < len(values):
            before = values[max(a - _TREND, 0) : a].mean(axis=0)
            after = values[b : b + _TREND].mean(axis=0)
            part = (np.arange(1, b - a + 1) / (b - a + 1.0))[:, None]
            out[a:b] = (1.0 - part) * before + part * after
    return out
