"""The one low-pass on both sides of the equation, ``F(tau) = F(Y) theta``.

As it is the *same* on both it averages the noise of the accelerations without shifting phase between the two (Swevers, Verdonck,
De Schutter 2007; filtered regressor: Slotine, Li 1987).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


@njit(**_JIT)  # type: ignore[untyped-decorator]
def low_pass(sections: FloatArray, state: FloatArray, x: FloatArray, part: float, y: FloatArray) -> None:
    """``y`` becomes what the sections let pass of ``part x``, shape (c,) each: all channels go through a section, then the
    next, of which the compiler makes vector instructions."""
    _section(sections[0], state[0], x, part, y)
    for s in range(1, sections.shape[0]):
        _section(sections[s], state[s], y, 1.0, y)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _section(section: FloatArray, state: FloatArray, x: FloatArray, part: float, y: FloatArray) -> None:
    b0, b1, b2, a1, a2 = section[0], section[1], section[2], section[4], section[5]
    first, second = state[0], state[1]
    for c in range(y.size):
        u = part * x[c]
        out = b0 * u + first[c]
        first[c] = b1 * u - a1 * out + second[c]
        second[c] = b2 * u - a2 * out
        y[c] = out


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

    Attributes:
        sections: of the filter, shape (order / 2, 6). state: of each, shape (order / 2, 2, number of channels).
        output: filtered channels.
    """

    def __init__(self, shape: tuple[int, ...], cutoff_hz: float, rate: float, order: int = 4) -> None:
        self.cutoff_hz = cutoff_hz
        self.sections = butterworth_sections(order, cutoff_hz, rate)
        self._steady = np.stack([1.0 - self.sections[:, 0], self.sections[:, 2] - self.sections[:, 5]], axis=1)
        size = math.prod(shape)
        self.state = np.zeros((len(self.sections), 2, size))
        self.output: FloatArray = np.zeros(shape)
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
            self.state[:] = self._steady[:, :, None] * flat
            self._primed = True
        low_pass(self.sections, self.state, flat, 1.0, self.output.reshape(-1))
        return self.output

    def mix(self, matrix: FloatArray) -> None:
        """From now on the last axis of the channels holds ``channels @ matrix``, shape (c, d), as if all inputs had been so."""
        shape = *self.state.shape[:2], -1
        self.state = (self.state.reshape(*shape, len(matrix)) @ matrix).reshape(shape)
        self.output = self.output @ matrix

    def rest(self) -> None:
        """Forget all, as if every input before had been zero."""
        self.state[:] = 0.0
        self._primed = True

    def reset(self) -> None:
        """Forget all: the next input primes the filter."""
        self._primed = False
