"""Zero-phase filters for recordings: position, velocity and acceleration from positions, and one low-pass for both sides.

All of them are finite and symmetric, so nothing is shifted in time, a recording can be worked through in pieces with the same
result, and what a gap spoils is known to the sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray
from sysid_ros.signals.low_pass import butterworth_sections

_STOP_DECIBEL = 80.0
_WIDTH = 4.0
"""Half width of the Gaussian low-pass in standard deviations."""

_SIGMA_TIMES_CUTOFF = 0.13250
"""Gaussian: exp(-2 pi^2 sigma^2 f^2) is 1/sqrt(2) at the cut-off where sigma f is this."""

_FIRST = np.array([-1.0 / 280.0, 4.0 / 105.0, -1.0 / 5.0, 4.0 / 5.0, 0.0, -4.0 / 5.0, 1.0 / 5.0, -4.0 / 105.0, 1.0 / 280.0])
_SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
"""Central differences of eighth order (Fornberg 1988), as convolutions."""


@dataclass(frozen=True, slots=True)
class SmoothMotion:
    """Channels of one stretch on an even grid after the zero-phase filter: t (M,) [s], q, v, a, tau (M, n).

    ``spoiled``, shape (M, n), is 10 where a value that must not be used went in, else 0.
    """

    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    tau: FloatArray
    spoiled: FloatArray


class KinematicFilter:
    """Low-pass, derivatives and decimation of a stretch of measurements, flat where the later low-pass lets motion through::

        q_s = h * q      v_s = h * dq/dt      a_s = h * d2q/dt2      tau_s = h * tau

    h is a Kaiser-windowed sinc (Kaiser 1974) that passes up to three times the cut-off and stops from six times on, so that
    positions and torque keep their shape and phase below the cut-off and the grid can be coarser than the measurements.

    Args:
        period: usual time between measurements [s]. cutoff_hz: of the low-pass to come [Hz].

    Attributes:
        step: measurements between grid points. grid_period: time between them [s]. half: measurements lost at each end.
    """

    def __init__(self, period: float, cutoff_hz: float) -> None:
        from scipy import signal  # takes longer to load than the rest of the package

        self.period = period
        rate = 1.0 / period
        stop = min(6.0 * cutoff_hz, 0.48 * rate)
        passed = min(3.0 * cutoff_hz, 0.6 * stop)
        taps, beta = signal.kaiserord(_STOP_DECIBEL, (stop - passed) / (0.5 * rate))
        low_pass = signal.firwin(taps | 1, 0.5 * (passed + stop), window=("kaiser", beta), fs=rate)
        self._smooth = np.pad(low_pass, 4)
        self._slope = np.convolve(low_pass, _FIRST[::-1] * -1.0) / period
        self._bend = np.convolve(low_pass, _SECOND) / period**2
        self.half = len(self._smooth) // 2
        self.step = max(1, int(rate / max(6.0 * stop, 180.0)))
        self.grid_period = self.step * period

    def apply(
        self,
        t: FloatArray,
        q: FloatArray,
        v: FloatArray | None,
        tau: FloatArray,
        spoiled: NDArray[np.bool_] | None = None,
    ) -> SmoothMotion | None:
        """The smooth motion of a stretch; None where it is shorter than the filter.

        Args:
            t: shape (N,). q: shape (N, n). tau: shape (N, c). v: measured velocities, shape (N, n), to take in place of the
                derivative of q, with their derivative as the acceleration; None for q's. spoiled: what must not be used, shape
                (N, n).
        """
        even, channels = on_even_grid(t, np.hstack([q, tau] if v is None else [q, tau, v]), self.period)
        if len(even) < 2 * self.half + 1:
            return None
        n = q.shape[1]
        position, torque, velocity = np.split(channels, [n, n + tau.shape[1]], axis=1)
        grid = even[self.half : len(even) - self.half : self.step]
        return SmoothMotion(
            t=grid,
            q=self._convolve(position, self._smooth),
            v=self._convolve(velocity, self._smooth) if v is not None else self._convolve(position, self._slope),
            a=self._convolve(velocity, self._slope) if v is not None else self._convolve(position, self._bend),
            tau=self._convolve(torque, self._smooth),
            spoiled=self._spoiled(t, grid, spoiled, n),
        )

    def _spoiled(self, t: FloatArray, grid: FloatArray, spoiled: NDArray[np.bool_] | None, n: int) -> FloatArray:
        out = np.zeros((len(grid), n))
        if spoiled is None or not spoiled.any():
            return out
        reach = self.half * self.period
        first, end = np.searchsorted(t, grid - reach), np.searchsorted(t, grid + reach, side="right")
        counts = np.concatenate([np.zeros((1, n)), np.cumsum(spoiled, axis=0)])
        return np.asarray(np.where(counts[end] > counts[first], 10.0, out))

    def _convolve(self, channels: FloatArray, kernel: FloatArray) -> FloatArray:
        from scipy import signal

        # one channel at a time: the whole of a long recording need not be copied
        lost = len(kernel) - 1
        count = -(-(len(channels) - lost) // self.step)
        out = np.empty((count, channels.shape[1]))
        centre = channels[0].copy()
        constant = kernel.sum()
        for j in range(channels.shape[1]):
            # far from zero a position would lose digits in its second difference
            x = channels[:, j] - centre[j]
            out[:, j] = signal.oaconvolve(x, kernel, mode="valid")[:: self.step] + constant * centre[j]
        return out


class GaussianLowPass:
    """The low-pass for both sides of the equation: ``g(t) ~ exp(-t^2 / (2 sigma^2))``, unit gain at rest, -3 dB at the cut-off.

    It has no negative part and the shortest memory for its band, so little is lost beside gaps and where a joint stands. Its
    derivative serves the momentum form: ``g * dp/dt = dg/dt * p``.

    Args:
        cutoff_hz: [Hz]. period: of the rows that go in [s].

    Attributes:
        kernel: shape (w,), w odd. slope: its derivative, shape (w,) [1/s].
    """

    def __init__(self, cutoff_hz: float, period: float) -> None:
        sigma = _SIGMA_TIMES_CUTOFF / cutoff_hz
        half = max(1, int(np.ceil(_WIDTH * sigma / period)))
        times = period * np.arange(-half, half + 1)
        kernel = np.exp(-0.5 * (times / sigma) ** 2)
        self.kernel: FloatArray = kernel / kernel.sum()
        # Row k is sum_i kernel_i x(t_k + times_i); of dx/dt it is -sum_i kernel'(times_i) x(t_k + times_i).
        slope = times / sigma**2 * self.kernel
        self.slope: FloatArray = slope / (slope @ times)

    @property
    def half(self) -> int:
        """Rows on each side of the middle."""
        return len(self.kernel) // 2


def low_passed(x: FloatArray, cutoff_hz: float, period: float, order: int = 4, padding: float | None = None) -> FloatArray:
    """Channels (N, ...) on an even grid through the Butterworth low-pass of :mod:`.low_pass` both ways: half the
    amplitude at the cut-off, no phase.

    Args:
        cutoff_hz: [Hz]. period: of the grid [s]. order: of one pass. padding: time by which the ends go on, mirrored at
            themselves [s]; None for a few samples.
    """
    from scipy import signal

    sections = butterworth_sections(order, cutoff_hz, 1.0 / period)
    length = None if padding is None else min(len(x) - 1, int(padding / period))
    return np.asarray(signal.sosfiltfilt(sections, x, axis=0, padlen=length))


def on_even_grid(t: FloatArray, channels: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    """Channels (N, c) at uneven times, on a grid of spacing ``period`` [s]: by the cubic through four neighbours, and in a
    straight line over lost measurements.

    On times that are even already nothing changes. Stamps jitter and messages get lost, while the filters work on even samples.
    """
    count = int(np.floor((t[-1] - t[0]) / period + 1e-6)) + 1
    even = t[0] + period * np.arange(count)
    if len(t) == count and np.max(np.abs(t - even)) < 1e-3 * period:
        return t, channels
    if len(t) < 4:
        return even[:0], channels[:0]
    after = np.clip(np.searchsorted(t, even), 1, len(t) - 1)
    first = np.clip(after - 2, 0, len(t) - 4)
    at = t[first[:, None] + np.arange(4)]
    weights = np.ones((count, 4))
    for i in range(4):
        for j in range(4):
            if j != i:
                weights[:, i] *= (even - at[:, j]) / (at[:, i] - at[:, j])
    before = after - 1
    part = np.clip((even - t[before]) / (t[after] - t[before]), 0.0, 1.0)
    gap = t[after] - t[before] > 1.6 * period
    out = np.empty((count, channels.shape[1]))
    for c in range(channels.shape[1]):
        x = channels[:, c]
        cubic = sum(weights[:, i] * x[first + i] for i in range(4))
        out[:, c] = np.where(gap, (1.0 - part) * x[before] + part * x[after], cubic)
    return even, out
