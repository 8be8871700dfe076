"""LowPassBank: the one low-pass that both sides of the equation go through."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


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
