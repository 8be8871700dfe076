"""Filters and derivatives at the robot's rate: measurements to samples, and one low-pass for both sides of the equation.

The acceleration decides most of the accuracy. It enters the regressor linearly, so it is left raw (a second difference,
unbiased) and both sides of the equation, ``F(tau) = F(Y) theta``, go through the *same* low-pass, which averages its noise
without shifting phase between the two (Swevers, Verdonck, De Schutter 2007; filtered regressor: Slotine, Li 1987).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy import signal

from sysid_ros.sample import FloatArray, Measurement, Sample

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _interpolate(t: FloatArray, channels: FloatArray, at: float, linear_from: int, out: FloatArray) -> None:
    """Channels (4, c) known at four times (4,), at a time between the middle two: cubic, and linear from one channel on."""
    for c in range(channels.shape[1]):
        out[c] = 0.0
    for i in range(4):
        weight = 1.0
        for j in range(4):
            if j != i:
                weight *= (at - t[j]) / (t[i] - t[j])
        for c in range(linear_from):
            out[c] += weight * channels[i, c]
    part = (at - t[1]) / (t[2] - t[1])
    for c in range(linear_from, channels.shape[1]):
        out[c] = (1.0 - part) * channels[1, c] + part * channels[2, c]


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
        self._n, self._period = n, period
        self._t = np.zeros(4)
        self._channels = np.zeros((4, 3 * n))
        self._count = 0
        self._next = 0.0
        self.filled = 0

    def push(self, measurement: Measurement) -> list[tuple[float, FloatArray]]:
        """Time and channels (q, v, tau side by side, shape (3 n,); v is NaN where it was not measured) of each grid point that is
        known now."""
        n = self._n
        self._t[:3], self._channels[:3] = self._t[1:], self._channels[1:]
        self._t[3] = measurement.t
        row = self._channels[3]
        row[:n], row[2 * n :] = measurement.q, measurement.tau
        row[n : 2 * n] = np.nan if measurement.v is None else measurement.v
        self._count += 1
        if self._count < 4:
            self._next = self._t[3] - self._period if self._count == 3 else 0.0
            return []
        out = []
        gap = self._t[2] - self._t[1] > self._GAP * self._period
        while self._next <= self._t[2] + 1e-3 * self._period:
            values = np.empty(3 * n)
            _interpolate(self._t, self._channels, self._next, n if gap else 3 * n, values)
            out.append((self._next, values))
            self._next += self._period
        if gap:
            self.filled += max(len(out) - 1, 0)
        return out


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _differentiate(q: FloatArray, slope: FloatArray, first: int, period: float, out: FloatArray) -> None:
    """Rows of ``out``: q, v (smooth) and a (raw) in the middle of a ring of even samples whose oldest entry is ``first``."""
    width, n = q.shape
    half = width // 2
    middle = (first + half) % width
    before, after = (first + half - 1) % width, (first + half + 1) % width
    for j in range(n):
        v = 0.0
        for k in range(width):
            v += slope[k] * q[(first + k) % width, j]
        out[0, j] = q[middle, j]
        out[1, j] = v
        out[2, j] = (q[after, j] - 2.0 * q[middle, j] + q[before, j]) / (period * period)


class CausalDerivative:
    """Position, velocity and acceleration with a fixed lag: ``half_width`` samples behind the newest one.

    On the even grid of :class:`Resampler`, the velocity is the slope of the cubic that fits best in a window of
    ``2 half_width + 1`` samples (Savitzky, Golay 1964); the acceleration is the raw second difference of the positions; position
    and torque are delayed to the same instant.

    Args:
        n: number of joints.
        period: usual time between measurements [s].
        half_width: samples on each side; at least 2.
        use_message_velocity: take the velocity of the message, delayed alike, where it has one.
    """

    def __init__(self, n: int, period: float, half_width: int, use_message_velocity: bool = False) -> None:
        self.half_width = half_width
        self.width = 2 * half_width + 1
        self.period = period
        self.resampler = Resampler(n, period)
        self._q = np.zeros((self.width, n))
        self._v = np.zeros((self.width, n))
        self._tau = np.zeros((self.width, n))
        self._t = np.zeros(self.width)
        self._slope = signal.savgol_coeffs(self.width, 3, deriv=1, delta=period, use="dot")
        self._use_message_velocity = use_message_velocity
        self._n = n
        self._next = 0
        self._filled = 0

    def push(self, measurement: Measurement) -> list[Sample]:
        """The samples that a measurement completes: usually one, none while the window fills, a few after a gap."""
        return [sample for t, values in self.resampler.push(measurement) if (sample := self._push(t, values)) is not None]

    def _push(self, t: float, values: FloatArray) -> Sample | None:
        n, i = self._n, self._next
        self._t[i] = t
        self._q[i], self._v[i], self._tau[i] = values[:n], values[n : 2 * n], values[2 * n :]
        self._next = first = (i + 1) % self.width
        if self._filled < self.width:
            self._filled += 1
            if self._filled < self.width:
                return None
        out = np.empty((3, n))
        _differentiate(self._q, self._slope, first, self.period, out)
        middle = (first + self.half_width) % self.width
        measured = self._use_message_velocity and not np.isnan(self._v[middle, 0])
        v = self._v[middle].copy() if measured else out[1]
        return Sample(float(self._t[middle]), out[0], v, out[2], self._tau[middle].copy())


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
        self._sections = signal.butter(order, cutoff_hz, output="sos", fs=rate)
        self._steady = signal.sosfilt_zi(self._sections)
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
