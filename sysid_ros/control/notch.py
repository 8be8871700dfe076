"""A notch filter for a resonance that a frequency response shows, and what it buys in a loop of position and velocity.

    N(s) = (s^2 + 2 z_n w s + w^2) / (s^2 + 2 z_d w s + w^2)

takes the factor z_n / z_d of what goes through it at w, and less and less away from it; its phase costs the loop some of its
margin below w, which grows with z_d.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray

ComplexArray = NDArray[np.complex128]
_WIDE = (0.05, 0.6)
"""Damping of the denominator that is allowed: a narrower one misses a resonance that is a few per cent off, a wider one costs the
loop too much phase."""
_WIDER = 5.0
"""Damping of the denominator over that of the resonance."""
_LINES = 5
"""Lines beside the peak that its frequency and damping are fitted to, on each side."""


@dataclass(frozen=True, slots=True)
class Resonance:
    """A peak of a response: undamped frequency [Hz], relative damping, and height over the response far around it."""

    frequency: float
    damping: float
    height: float


@dataclass(frozen=True, slots=True)
class Notch:
    """The filter: frequency w [Hz], z_n and z_d."""

    frequency: float
    numerator: float
    denominator: float

    def response(self, f: FloatArray) -> ComplexArray:
        """At f [Hz], of the shape of f."""
        s, w = 2j * np.pi * np.asarray(f), 2.0 * np.pi * self.frequency
        both = [s**2 + 2.0 * z * w * s + w**2 for z in (self.numerator, self.denominator)]
        return np.asarray(both[0] / both[1])

    def discrete(self, period: float) -> tuple[FloatArray, FloatArray]:
        """Numerator and denominator in z for a step [s], prewarped at w, shape (3,) each (Tustin)."""
        from scipy import signal

        w = 2.0 * np.tan(np.pi * self.frequency * period) / period
        b, a = ([1.0, 2.0 * z * w, w**2] for z in (self.numerator, self.denominator))
        found = signal.bilinear(b, a, 1.0 / period)
        return np.asarray(found[0], dtype=np.float64), np.asarray(found[1], dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Benefit:
    """What a notch does to a loop.

    Attributes:
        peak, peak_with: largest response of the closed loop about the resonance, from what is wanted to what is measured
            (complementary sensitivity), without and with the notch. decibel: by how much it falls.
        phase_lost: at the crossover of the open loop below the resonance [degrees].
    """

    peak: float
    peak_with: float
    decibel: float
    phase_lost: float


def resonance_of(f: FloatArray, response: ComplexArray, low: float, high: float) -> Resonance:
    """The highest peak of a response in a band, its frequency between the lines.

    ``1 / H`` about a lightly damped pole is a line in s, ``c (s - p)``: fitted to the lines about the peak, weighted by
    ``|H|``, its zero is the pole (a rational fit of order one, Levy 1959).

    Args:
        f: lines [Hz], shape (F,). response: shape (F,). low, high: of the band [Hz].

    Raises:
        DataError: the band has fewer than five lines, or no peak inside of it.
    """
    inside = np.flatnonzero((f >= low) & (f <= high))
    if len(inside) < 5:
        raise DataError(f"{len(inside)} lines lie from {low:g} to {high:g} Hz; five are needed. Measure with a longer period.")
    size = np.abs(response[inside])
    at = int(np.argmax(size))
    if at in (0, len(inside) - 1):
        raise DataError(f"the response has no peak from {low:g} to {high:g} Hz: it is largest at the band's end. Widen the band.")
    half = size > 0.5 * size[at]
    near = [k for k in range(max(0, at - _LINES), min(len(inside), at + _LINES + 1)) if half[k] or abs(k - at) <= 2]
    rows, s = inside[near], 2j * np.pi * f[inside[near]]
    H = response[rows]
    # H (1 + b (s - s0)) = a + d (s - s0): one pole, one zero for what else there is
    centre = 2j * np.pi * f[inside[at]]
    x = (s - centre) / abs(centre)
    X = np.stack([np.ones_like(x), x, -H * x], axis=1) if len(near) > 3 else np.stack([np.ones_like(x), -H * x], axis=1)
    theta = np.linalg.lstsq(X, H, rcond=None)[0]
    pole = complex(centre - abs(centre) / theta[-1])
    w = abs(pole)
    return Resonance(float(w / (2.0 * np.pi)), float(-pole.real / w), float(size[at] / np.median(size)))


def notch_for(found: Resonance, depth: float = 0.1) -> Notch:
    """As wide as the resonance with room for a change of it, and ``depth`` at its bottom."""
    wide = float(np.clip(_WIDER * abs(found.damping), *_WIDE))
    return Notch(found.frequency, depth * wide, wide)


def benefit(
    f: FloatArray, plant: ComplexArray, notch: Notch, gains: tuple[float, float], delay: float = 0.0, around: float = 0.3
) -> Benefit:
    """What a notch behind the controller ``kp + kd s`` does, by the measured response of the plant.

    Args:
        f: lines [Hz], shape (F,). plant: from torque to measured velocity, shape (F,). gains: kp [N m/rad], kd [N m s/rad].
        delay: of the loop [s]. around: part of the frequency about the notch in which the peak is looked for.
    """
    s = 2j * np.pi * f
    controller = (gains[0] / s + gains[1]) * np.exp(-s * delay)
    near = np.abs(f / notch.frequency - 1.0) <= around
    loops = [plant * controller * n for n in (np.ones_like(s), notch.response(f))]
    peaks = [float(np.max(np.abs(loop / (1.0 + loop))[near])) for loop in loops]
    crossing = np.flatnonzero((np.abs(plant * controller) > 1.0) & (f < notch.frequency * (1.0 - around)))
    at = float(f[crossing[-1]]) if crossing.size else float(f[0])
    lost = float(-np.degrees(np.angle(notch.response(np.array([at]))[0])))
    return Benefit(peaks[0], peaks[1], float(20.0 * np.log10(peaks[0] / peaks[1])), lost)
