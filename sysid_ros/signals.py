"""Filters and derivatives at the robot's rate: measurements to samples, and one low-pass for both sides of the equation.

The acceleration decides most of the accuracy. It enters the regressor linearly, so it is left raw (a second difference,
unbiased) and both sides of the equation, ``F(tau) = F(Y) theta``, go through the *same* low-pass, which averages its noise
without shifting phase between the two (Swevers, Verdonck, De Schutter 2007; filtered regressor: Slotine, Li 1987).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray, Measurement, Sample

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _resample(
    window: FloatArray, clock: FloatArray, t: float, q: FloatArray, v: FloatArray, tau: FloatArray, period: float, gap: float
) -> FloatArray:
    """Take a measurement into the window; the grid points that are known now, shape (k, 1 + 3 n).

    Rows of ``window``, shape (4, 1 + 3 n), and of what comes back are t, q, v, tau. ``clock`` holds the measurements taken in so
    far and the time of the next grid point. Steps longer than ``gap`` periods are gaps.
    """
    n = q.size
    window[:3] = window[1:]
    newest = window[3]
    newest[0] = t
    newest[1 : 1 + n], newest[1 + n : 1 + 2 * n], newest[1 + 2 * n :] = q, v, tau
    clock[0] += 1.0
    if clock[0] < 4.0:
        clock[1] = t - period
        return np.empty((0, newest.size))
    times = window[:, 0]
    step = times[2] - times[1]
    linear_from = 1 + n if step > gap * period else newest.size
    count = max(int(np.floor((times[2] + 1e-3 * period - clock[1]) / period)) + 1, 0)
    out = np.empty((count, newest.size))
    for k in range(count):
        at = clock[1]
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
        clock[1] += period
    return out


class Resampler:
    """Puts measurements on an even grid of times, one measurement late.

    Stamps jitter and messages get lost, while the low-pass works on even samples: noise of the positions cancels in it only as
    long as each acceleration is the second difference of the same, evenly spaced positions. Between two measurements the
    channels are interpolated by the cubic through the two on each side; over a gap the torque goes in a straight line, because
    its noise would bend the cubic. On stamps that are even already nothing changes.

    Args:
        n: number of joints. period: spacing of the grid [s].

    Attributes:
        filled: grid points that lie in a gap of more than 1.6 periods.
    """

    _GAP = 1.6

    def __init__(self, n: int, period: float) -> None:
        self._period = period
        self._window = np.zeros((4, 1 + 3 * n))
        self._clock = np.zeros(2)
        self._no_velocity = np.full(n, np.nan)
        self._no_velocity.setflags(write=False)  # as a measured one is: another type would be compiled for anew
        self.filled = 0

    def push(self, measurement: Measurement) -> FloatArray:
        """The grid points that are known now, usually one, a row each: t, q, v (NaN where it was not measured) and tau side by
        side, shape (k, 1 + 3 n)."""
        v = self._no_velocity if measurement.v is None else measurement.v
        grid: FloatArray = _resample(
            self._window, self._clock, measurement.t, measurement.q, v, measurement.tau, self._period, self._GAP
        )
        if len(grid) > 1 and self._window[2, 0] - self._window[1, 0] > self._GAP * self._period:
            self.filled += len(grid) - 1
        return grid


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _differentiate(
    ring: FloatArray, slope: FloatArray, newest: int, values: FloatArray, period: float, use_measured: bool
) -> tuple[float, FloatArray]:
    """Put a row t, q, v, tau at ``newest`` into the ring of even samples; time of the middle, and q, v (smooth), a (raw) and tau
    there, shape (4, n)."""
    width, n = slope.size, (values.size - 1) // 3
    ring[newest] = values
    half = width // 2
    first = newest + 1
    middle, before, after = (first + half) % width, (first + half - 1) % width, (first + half + 1) % width
    out = np.zeros((4, n))
    for k in range(width):
        row = ring[(first + k) % width]
        for j in range(n):
            out[1, j] += slope[k] * row[1 + j]
    measured = use_measured and not np.isnan(ring[middle, 1 + n])
    for j in range(n):
        q = ring[middle, 1 + j]
        out[0, j] = q
        if measured:
            out[1, j] = ring[middle, 1 + n + j]
        out[2, j] = (ring[after, 1 + j] - 2.0 * q + ring[before, 1 + j]) / (period * period)
        out[3, j] = ring[middle, 1 + 2 * n + j]
    return ring[middle, 0], out


def slope_weights(half_width: int, period: float) -> FloatArray:
    """Weights that give the slope, in the middle, of the cubic that fits ``2 half_width + 1`` even samples best (Savitzky, Golay
    1964), shape (2 half_width + 1,) [1/s].

    Args:
        half_width: samples on each side, at least 2. period: time between samples [s].
    """
    x = np.arange(-half_width, half_width + 1) / half_width
    weights: FloatArray = np.linalg.pinv(np.vander(x, 4, increasing=True))[1] / (half_width * period)
    return weights


class CausalDerivative:
    """Position, velocity and acceleration with a fixed lag: ``half_width`` samples behind the newest one.

    On the even grid of :class:`Resampler`, the velocity is the slope of the cubic that fits best in a window of
    ``2 half_width + 1`` samples; the acceleration is the raw second difference of the positions; position and torque are delayed
    to the same instant.

    Args:
        n: number of joints.
        period: usual time between measurements [s].
        half_width: samples on each side; at least 2.
        use_message_velocity: take the velocity of the message, delayed alike, where it has one.
    """

    def __init__(self, n: int, period: float, half_width: int, use_message_velocity: bool = False) -> None:
        self.width = 2 * half_width + 1
        self.period = period
        self.resampler = Resampler(n, period)
        self._ring = np.zeros((self.width, 1 + 3 * n))
        self._slope = slope_weights(half_width, period)
        self._use_message_velocity = use_message_velocity
        self._next = 0
        self._filled = 0

    def push(self, measurement: Measurement) -> list[Sample]:
        """The samples that a measurement completes: usually one, none while the window fills, a few after a gap."""
        samples = []
        for values in self.resampler.push(measurement):
            t, channels = _differentiate(self._ring, self._slope, self._next, values, self.period, self._use_message_velocity)
            self._next = (self._next + 1) % self.width
            self._filled += 1
            if self._filled >= self.width:
                q, v, a, tau = channels
                samples.append(Sample(t, q, v, a, tau))
        return samples


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _filter(sections: FloatArray, state: FloatArray, x: FloatArray, y: FloatArray) -> None:
    for c in range(x.size):
        u = x[c]
        for s in range(sections.shape[0]):
            out = sections[s, 0] * u + state[s, 0, c]
            state[s, 0, c] = sections[s, 1] * u - sections[s, 4] * out + state[s, 1, c]
            state[s, 1, c] = sections[s, 2] * u - sections[s, 5] * out
            u = out
        y[c] = u


def butterworth_sections(order: int, cutoff_hz: float, rate: float) -> FloatArray:
    """Butterworth low-pass of even order as sections b0 b1 b2 1 a1 a2, each of unit gain at rest, shape (order / 2, 6).

    The analog sections 1 / (s^2 + 2 sin(pi (2 k + 1) / (2 order)) s + 1) under the bilinear transform, the cut-off warped so that
    it stays where it is (Oppenheim, Schafer 2010, section 7.2).

    Args:
        cutoff_hz: frequency of half the power [Hz], below half of ``rate`` [Hz].
    """
    K = math.tan(math.pi * cutoff_hz / rate)
    sections = np.empty((order // 2, 6))
    for k, section in enumerate(sections):
        damping = 2.0 * math.sin(math.pi * (2 * k + 1) / (2 * order)) * K
        scale = 1.0 / (1.0 + damping + K * K)
        b = K * K * scale
        section[:] = b, 2.0 * b, b, 1.0, 2.0 * (K * K - 1.0) * scale, (1.0 - damping + K * K) * scale
    return sections


class LowPassBank:
    """The same Butterworth low-pass of unit gain on many channels, primed with the first input.

    Args:
        shape: shape of the array of channels.
        cutoff_hz: cut-off [Hz].
        rate: samples a second [Hz].
        order: even order.
    """

    def __init__(self, shape: tuple[int, ...], cutoff_hz: float, rate: float, order: int = 4) -> None:
        self.cutoff_hz = cutoff_hz
        self._sections = butterworth_sections(order, cutoff_hz, rate)
        self._steady = np.stack([1.0 - self._sections[:, 0], self._sections[:, 2] - self._sections[:, 5]], axis=1)
        size = math.prod(shape)
        self._state = np.zeros((len(self._sections), 2, size))
        self.output: FloatArray = np.zeros(shape)
        self._flat = self.output.reshape(-1)
        self._primed = False

    @property
    def memory(self) -> float:
        """Time after which an input has all but left the output [s]."""
        return 1.25 / self.cutoff_hz

    @property
    def delay(self) -> float:
        """Group delay at low frequency [s] (Butterworth of order 4: 2.613 / (2 pi cutoff))."""
        return 2.613 / (2.0 * math.pi * self.cutoff_hz)

    def push(self, x: FloatArray) -> FloatArray:
        """Filtered channels: ``output``, which the next call overwrites."""
        flat = x.reshape(-1)
        if not self._primed:
            self._state[:] = self._steady[:, :, None] * flat
            self._primed = True
        _filter(self._sections, self._state, flat, self._flat)
        return self.output

    def reset(self) -> None:
        """Forget all: the next input primes the filter."""
        self._primed = False


def window_half_width(rate: float) -> int:
    """Samples on each side of the derivative's window: 10 ms, at least 2 samples."""
    return int(min(max(round(0.010 * rate), 2), 15))


def default_cutoff(rate: float) -> float:
    """Cut-off of the low-pass for data at ``rate`` [Hz]: 10 Hz, and a twentieth of the rate where that is less."""
    return min(10.0, rate / 20.0)
