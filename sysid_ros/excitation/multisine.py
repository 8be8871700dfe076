"""Multisines: motions of odd harmonics about a posture, from which frequency responses are measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.excitation.feasibility import Feasibility
from sysid_ros.excitation.motion_limits import MotionLimits
from sysid_ros.sample import FloatArray

_SHRINKS, _SHRINK = 60, 0.9
_ROOM = 0.95
"""Part of the limits that is used before torques and collisions are looked at."""


@dataclass(frozen=True, eq=False)
class Multisine:
    """``q(t) = c + e(t) sum_k a_k sin(2 pi h_k t / T + phi_k)``, h_k odd, e a quintic from rest to 1 in ``ramp`` and back.

    Between the ramps it is exactly periodic; even harmonics and the odd ones that are left free show distortion.

    Attributes:
        centre: shape (n,) [rad or m]. amplitude, phase: shape (H, n). harmonics: odd, shape (H,). period: T [s].
        periods: whole ones between the ramps. ramp: [s], a whole number of periods.
    """

    centre: FloatArray
    amplitude: FloatArray
    phase: FloatArray
    harmonics: FloatArray
    period: float
    periods: int
    ramp: float

    @property
    def duration(self) -> float:
        """[s]"""
        return self.periods * self.period + 2.0 * self.ramp

    @property
    def frequencies(self) -> FloatArray:
        """Shape (H,) [Hz]."""
        return np.asarray(self.harmonics / self.period)

    def grid(self, step: float, one_period: bool = False) -> FloatArray:
        """Times about ``step`` apart from the start to the end, or to that of the first period behind the ramp, which ends as it
        began [s]."""
        if one_period:
            return np.linspace(0.0, self.ramp + self.period, round((self.ramp + self.period) / step) + 1)
        return np.linspace(0.0, self.duration, round(self.duration / step) + 1)

    def sample(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration, shape (len(t), n) each; the joints rest before and after."""
        t = np.clip(np.asarray(t, dtype=float), 0.0, self.duration)
        w = 2.0 * np.pi * self.frequencies[:, None]
        angle = w * t[:, None, None] + self.phase
        s, c = np.sin(angle), np.cos(angle)
        x, v, a = (np.sum(self.amplitude * y, axis=1) for y in (s, w * c, -(w**2) * s))
        e, de, dde = (y[:, None] for y in self._envelope(t))
        return self.centre + e * x, e * v + de * x, e * a + 2.0 * de * v + dde * x

    def scaled(self, factor: float | FloatArray) -> Multisine:
        """With amplitudes ``factor`` times as large, one for all or one a joint."""
        return replace(self, amplitude=self.amplitude * factor)

    def _envelope(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        left = np.clip(t / self.ramp, 0.0, 1.0)
        right = np.clip((self.duration - t) / self.ramp, 0.0, 1.0)
        s, sign = np.where(left < right, left, right), np.where(left < right, 1.0, -1.0)
        return (
            s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
            sign * 30.0 * s**2 * (1.0 - s) ** 2 / self.ramp,
            60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / self.ramp**2,
        )


def schroeder(power: FloatArray) -> FloatArray:
    """Phases that keep the peak of a sum of sines low, of their powers, shape (H,) (Schroeder 1970)."""
    share = power / power.sum()
    return np.asarray(-2.0 * np.pi * np.concatenate([[0.0], np.cumsum(np.cumsum(share))[:-1]]))


def crest_factor(x: FloatArray) -> float:
    """Peak over rms."""
    return float(np.max(np.abs(x)) / np.sqrt(np.mean(x**2)))


def multisines(
    limits: MotionLimits,
    feasibility: Feasibility,
    band: tuple[float, float],
    period: float,
    periods: int,
    joints: Sequence[int] = (),
    posture: FloatArray | None = None,
) -> list[Multisine]:
    """As many experiments as joints that move: at every frequency the joints' amplitudes of all experiments are an orthogonal
    matrix (Dobrowiecki, Schoukens 2007), so that each joint's response is told from the others' with the least noise.

    Args:
        limits: that are kept. feasibility: the same with collisions. band: lowest and highest frequency [Hz]. period: [s].
        joints: that move; all by default. posture: about which; the middle of the ranges by default.

    Raises:
        SettingsError: the band holds no two odd harmonics, or nothing that moves is feasible.
    """
    harmonics = np.arange(1, int(np.floor(band[1] * period + 1e-9)) + 1, 2)
    harmonics = harmonics[harmonics >= band[0] * period - 1e-9]
    if len(harmonics) < 2 or periods < 1:
        raise SettingsError(
            f"the band from {band[0]:g} to {band[1]:g} Hz holds {len(harmonics)} odd harmonics of {1.0 / period:g} Hz, and "
            f"there are {periods} periods; two and one are the least. Widen the band, or make the period longer."
        )
    n = len(limits.lower)
    moving = list(joints) or list(range(n))
    centre = 0.5 * (limits.lower + limits.upper) if posture is None else posture
    shape = np.zeros((len(harmonics), n))
    # the same velocity at every frequency
    shape[:, moving] = 1.0 / harmonics[:, None]
    phase = schroeder(np.ones(len(harmonics)))[:, None] + np.zeros(n)
    ramp = period * max(1, round(1.0 / period))
    out = []
    for e in range(len(moving)):
        shift = np.zeros(n)
        shift[moving] = 2.0 * np.pi * e * np.arange(len(moving)) / len(moving)
        out.append(Multisine(centre, shape, phase + shift, harmonics.astype(float), period, periods, ramp))
    factor = np.min([_within(m, limits) for m in out], axis=0)
    for _ in range(_SHRINKS):
        if all(feasibility.keeps(m.scaled(factor)) for m in out):
            return [m.scaled(factor) for m in out]
        factor = _SHRINK * factor
    raise SettingsError("no multisine about this posture keeps torques and distances. Give another posture with --start.")


def _within(m: Multisine, limits: MotionLimits) -> FloatArray:
    """The largest factor of each joint that position, velocity and acceleration allow, shape (n,)."""
    q, v, a = m.sample(m.grid(2e-3, one_period=True))
    room = np.minimum(limits.upper - m.centre, m.centre - limits.lower)
    used = np.stack(
        [np.abs(q - m.centre) / np.maximum(room, 1e-12), np.abs(v) / limits.velocity, np.abs(a) / limits.acceleration]
    )
    return np.asarray(_ROOM / np.maximum(used.max(axis=(0, 1)), 1e-12))
