"""Derivatives at the robot's rate: measurements to samples.

The acceleration decides most of the accuracy. It enters the regressor linearly, so it is left raw (a second difference,
unbiased), and the low-pass on both sides of the equation averages its noise, see :mod:`.low_pass`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray, Measurement, Sample
from sysid_ros.signals.spikes import remove_spikes
from sysid_ros.signals.window_weights import slope_weights, value_weights

SLOW: Final = 0.06  # speed of a joint below which dry friction is not what a model says [rad/s]
GAP: Final = 1.6  # periods from one measurement to the next, above which some were lost
MEASUREMENTS, NEXT, POINTS, FILLED, SPIKES = range(5)  # entries of a clock: counts, but for NEXT, the time of the next point [s]

_PLACES = 16  # for samples that one measurement completes, at first
_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _resample(
    window: FloatArray,
    clock: FloatArray,
    usual: FloatArray,
    t: float,
    q: FloatArray,
    v: FloatArray,
    tau: FloatArray,
    period: float,
    gap: float,
    alone: bool,
) -> FloatArray:
    """Take a measurement into the window; the points of an even grid of times that are known now, shape (k, 1 + 3 n).

    Stamps jitter and messages get lost, while the low-pass works on even samples: noise of the positions cancels in it only as
    long as each acceleration is the second difference of the same, evenly spaced positions. Between two measurements the channels
    are interpolated by the cubic through the two on each side, and over a gap (a step of more than ``gap`` periods) the torque in
    a straight line. On even stamps nothing changes. Spikes of the torque are taken out before, see :func:`remove_spikes`.

    Rows of ``window``, shape (4, 1 + 3 n), and of what comes back are t, q, v, tau.
    """
    n = q.size
    window[:3] = window[1:]
    newest = window[3]
    newest[0] = t
    newest[1 : 1 + n], newest[1 + n : 1 + 2 * n], newest[1 + 2 * n :] = q, v, tau
    clock[MEASUREMENTS] += 1.0
    if clock[MEASUREMENTS] < 4.0:
        clock[NEXT] = t - period
        return np.empty((0, newest.size))
    clock[SPIKES] += remove_spikes(window, 1 + 2 * n, usual, alone)
    times = window[:, 0]
    step = times[2] - times[1]
    linear_from = 1 + n if step > gap * period else newest.size
    count = max(int(np.floor((times[2] + 1e-3 * period - clock[NEXT]) / period)) + 1, 0)
    if step > gap * period and count > 0:
        clock[FILLED] += count - 1
    out = np.empty((count, newest.size))
    for k in range(count):
        at = clock[NEXT]
        out[k] = 0.0
        for i in range(4):
            weight = 1.0
            for j in range(4):
                if j != i:
                    weight *= (at - times[j]) / (times[i] - times[j])
            for c in range(1, linear_from):
                out[k, c] += weight * window[i, c]
        part = (at - times[1]) / step
        for c in range(linear_from, newest.size):
            out[k, c] = (1.0 - part) * window[1, c] + part * window[2, c]
        out[k, 0] = at
        clock[NEXT] += period
    return out


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _differentiate(
    ring: FloatArray, weights: FloatArray, newest: int, period: float, use_measured: bool, out: FloatArray
) -> float:
    """Time of the middle of a ring of even samples, rows t, q, v, tau with the last one at ``newest``; q and v (smooth), a (raw)
    and tau there go to ``out``, shape (4, n). ``weights`` are those of the position and of the slope, shape (2, width)."""
    width, n = weights.shape[1], out.shape[1]
    half = width // 2
    first = newest + 1
    middle, before, after = (first + half) % width, (first + half - 1) % width, (first + half + 1) % width
    out[:2] = 0.0
    for k in range(width):
        past = ring[(first + k) % width]
        for j in range(n):
            out[0, j] += weights[0, k] * past[1 + j]
            out[1, j] += weights[1, k] * past[1 + j]
    measured = use_measured and not np.isnan(ring[middle, 1 + n])
    for j in range(n):
        if measured:
            out[1, j] = ring[middle, 1 + n + j]
        out[2, j] = (ring[after, 1 + j] - 2.0 * ring[middle, 1 + j] + ring[before, 1 + j]) / (period * period)
        out[3, j] = ring[middle, 1 + 2 * n + j]
    return float(ring[middle, 0])


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _advance(
    window: FloatArray,
    clock: FloatArray,
    usual: FloatArray,
    ring: FloatArray,
    weights: FloatArray,
    t: float,
    q: FloatArray,
    v: FloatArray,
    tau: FloatArray,
    period: float,
    use_measured: bool,
    alone: bool,
    times: FloatArray,
    out: FloatArray,
) -> int:
    """Take in a measurement; time, and q, v, a, tau, of each sample that it completes go to ``times`` and ``out``, shapes (k,),
    (k, 4, n). How many these are; if these have no place, nothing is taken in, and it is minus the places that are needed."""
    width, completed = weights.shape[1], 0
    if clock[MEASUREMENTS] >= 3.0:
        needed = int(np.floor((window[3, 0] + 1e-3 * period - clock[NEXT]) / period)) + 1
        if needed > times.size:
            return -needed
    grid = _resample(window, clock, usual, t, q, v, tau, period, GAP, alone)
    for point in range(len(grid)):
        newest = int(clock[POINTS]) % width
        ring[newest] = grid[point]
        clock[POINTS] += 1.0
        if clock[POINTS] >= width:
            times[completed] = _differentiate(ring, weights, newest, period, use_measured, out[completed])
            completed += 1
    return completed


class CausalDerivative:
    """Position, velocity and acceleration with a fixed lag: ``half_width`` samples behind the newest one.

    Measurements are put on an even grid first, one measurement late. The velocity is the slope of the cubic that fits best in a
    window of ``2 half_width + 1`` samples; the acceleration is the raw second difference of the positions; the position is read
    such that its noise does not correlate with the acceleration's; the torque is delayed to the same instant.

    Args:
        n: number of joints. period: usual time between measurements [s].
        half_width: samples on each side; at least 2.
        use_message_velocity: take the velocity of the message, delayed alike, where it has one.
        impacts: the robot suffers impacts, which are no spikes.

    Attributes:
        times, channels: of the samples that the last :meth:`advance` completed, shape (k,) and, of q, v, a, tau, (k, 4, n) with k
            large enough; overwritten by the next.
    """

    def __init__(self, n: int, period: float, half_width: int, use_message_velocity: bool = False, impacts: bool = False) -> None:
        self.period = period
        self._window = np.zeros((4, 1 + 3 * n))
        self._clock, self._usual = np.zeros(5), np.zeros(2 * n + 1)
        self._ring = np.zeros((2 * half_width + 1, 1 + 3 * n))
        self._weights = np.stack([value_weights(half_width), slope_weights(half_width, period)])
        self.times, self.channels = np.zeros(_PLACES), np.zeros((_PLACES, 4, n))
        self._no_velocity = np.full(n, np.nan)
        self._no_velocity.setflags(write=False)  # as a measured one is: another type would be compiled for anew
        self._kept = self._window, self._clock, self._usual, self._ring, self._weights
        self._rules = period, use_message_velocity, impacts

    @property
    def filled(self) -> int:
        """Grid points that were interpolated over lost measurements so far."""
        return int(self._clock[FILLED])

    @property
    def spikes(self) -> int:
        """Torques that were taken out as spikes so far, the middle of their neighbours in their place."""
        return int(self._clock[SPIKES])

    def push(self, measurement: Measurement) -> list[Sample]:
        """The samples that a measurement completes: usually one, none while the window fills, a few after a gap."""
        return [Sample(float(self.times[k]), *self.channels[k].copy()) for k in range(self.advance(measurement))]

    def advance(self, measurement: Measurement) -> int:
        """As :meth:`push`; how many they are. They stand in ``times`` and ``channels``."""
        m, v = measurement, self._no_velocity if measurement.v is None else measurement.v
        completed: int = _advance(*self._kept, m.t, m.q, v, m.tau, *self._rules, self.times, self.channels)
        if completed >= 0:
            return completed
        self.times, self.channels = np.zeros(-completed), np.zeros((-completed, *self.channels.shape[1:]))
        return self.advance(measurement)


@njit(cache=True)  # type: ignore[untyped-decorator]
def fill_beside(raw: FloatArray, first: int, v: FloatArray, a: FloatArray, tau: FloatArray) -> None:
    """The channels beside the equation: v, a, tau and how far each joint is from moving, in four columns from ``first`` on."""
    for j in range(v.size):
        raw[j, first] = v[j]
        raw[j, first + 1] = a[j]
        raw[j, first + 2] = tau[j]
        raw[j, first + 3] = max(1.0 - abs(v[j]) / SLOW, 0.0)
