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
def _window_weights(t: FloatArray, first: int, centre: float, weights: FloatArray) -> None:
    """Weights of the value and the slope at ``centre`` of the cubic that fits best through a ring of stamps."""
    width = t.size
    moments = np.zeros(7)
    scale = 0.0
    for k in range(width):
        scale = max(scale, abs(t[k] - centre))
    for k in range(width):
        u = (t[(first + k) % width] - centre) / scale
        power = 1.0
        for i in range(7):
            moments[i] += power
            power *= u
    normal = np.empty((4, 4))
    for i in range(4):
        for j in range(4):
            normal[i, j] = moments[i + j]
    inverse = np.linalg.inv(normal)
    for k in range(width):
        u = (t[(first + k) % width] - centre) / scale
        weights[0, k] = inverse[0, 0] + u * (inverse[0, 1] + u * (inverse[0, 2] + u * inverse[0, 3]))
        weights[1, k] = (inverse[1, 0] + u * (inverse[1, 1] + u * (inverse[1, 2] + u * inverse[1, 3]))) / scale


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _push(t: FloatArray, q: FloatArray, weights: FloatArray, first: int, period: float, out: FloatArray, smooth: bool) -> None:
    """Rows of ``out``: q, v (smooth) and a (raw) at the middle of the ring whose oldest entry is ``first``."""
    width, n = q.shape
    half = width // 2
    middle = (first + half) % width
    before, after = (first + half - 1) % width, (first + half + 1) % width
    centre = t[middle]
    uniform = True
    for k in range(width):
        if abs(t[(first + k) % width] - centre - (k - half) * period) > 0.02 * period:
            uniform = False
            break
    if not uniform:
        local = np.empty_like(weights)
        _window_weights(t, first, centre, local)
    else:
        local = weights
    h0, h1 = centre - t[before], t[after] - centre
    for j in range(n):
        value, slope = 0.0, 0.0
        origin = q[middle, j]
        for k in range(width):
            x = q[(first + k) % width, j] - origin
            value += local[0, k] * x
            slope += local[1, k] * x
        out[0, j] = origin + value if smooth else origin
        out[1, j] = slope
        out[2, j] = 2.0 * ((q[after, j] - origin) / h1 - (origin - q[before, j]) / h0) / (h0 + h1)


class CausalDerivative:
    """Position, velocity and acceleration with a fixed lag: ``half_width`` samples behind the newest measurement.

    A cubic is fitted to the actual stamps in a window of ``2 half_width + 1`` samples (Savitzky, Golay 1964), so jitter and
    lost messages do no harm; the acceleration is the raw second difference of the same positions; the torque is delayed to the
    same instant.

    Args:
        n: number of joints.
        period: usual time between samples [s].
        half_width: samples on each side; at least 2.
        use_message_velocity: take the velocity of the message, delayed alike, in place of the slope of the cubic, where it has
            one.
    """

    def __init__(self, n: int, period: float, half_width: int, use_message_velocity: bool = False) -> None:
        self.half_width = half_width
        self.width = 2 * half_width + 1
        self.period = period
        self._t = np.zeros(self.width)
        self._q = np.zeros((self.width, n))
        self._v = np.zeros((self.width, n))
        self._tau = np.zeros((self.width, n))
        self._weights = np.empty((2, self.width))
        _window_weights((np.arange(self.width) - half_width) * period, 0, 0.0, self._weights)
        self._use_message_velocity = use_message_velocity
        self._n = n
        self._next = 0
        self._filled = 0

    def push(self, measurement: Measurement) -> Sample | None:
        """The sample in the middle of the window, or None while it fills."""
        i = self._next
        self._t[i] = measurement.t
        self._q[i] = measurement.q
        self._tau[i] = measurement.tau
        if self._use_message_velocity:
            self._v[i] = np.nan if measurement.v is None else measurement.v
        self._next = first = (i + 1) % self.width
        if self._filled < self.width:
            self._filled += 1
            if self._filled < self.width:
                return None
        out = np.empty((3, self._n))
        _push(self._t, self._q, self._weights, first, self.period, out, True)
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
