"""What the trunk of the simulated quadruped is to do, and which feet stand meanwhile, in the axes of the ground."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sysid_ros.robot.rotation import rotation_of
from sysid_ros.sample import FloatArray

GAITS = ("stand", "sway", "trot", "turn")
WALKS = ("trot", "turn")
"""Gaits whose feet step: a turn is a trot on the spot."""

_DIFFERENCE = 1e-3


@dataclass(frozen=True, slots=True)
class TrunkReference:
    """Wanted motion of the trunk's origin and axes, in the axes of the ground (z is its normal).

    Attributes:
        rotation: shape (3, 3). position, velocity, acceleration: shape (3,). omega, omega_dot: shape (3,) [rad/s], [rad/s^2].
    """

    rotation: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    omega: FloatArray
    omega_dot: FloatArray


class TrunkMotion:
    """Standing still, swaying over planted feet, or walking.

    Sway moves all six: position and roll, pitch, yaw are each a random Fourier series of three harmonics, blended in over a
    second. Trot walks along a slowly wandering velocity.

    Args:
        gait: one of :data:`GAITS`. height: of the trunk's origin over the ground [m].
        rng: of the series. extent: factor on the sway's amplitudes. speed: of the trot [m/s].
    """

    _SHIFT = np.array([0.025, 0.02, 0.02])
    _TURN = np.array([0.13, 0.13, 0.12])
    _BLEND = 1.0

    def __init__(self, gait: str, height: float, rng: np.random.Generator, extent: float = 1.0, speed: float = 0.2) -> None:
        self.gait, self.height = gait, height
        self._omega = 2.0 * math.pi * 0.35 * np.arange(1, 4)
        phase = rng.uniform(0.0, 2.0 * math.pi, (6, 3))
        share = rng.uniform(0.5, 1.0, (6, 3)) / np.arange(1, 4)
        share /= share.sum(axis=1, keepdims=True)
        size = np.concatenate([self._SHIFT, self._TURN]) * extent if gait == "sway" else np.zeros(6)
        self._sine, self._cosine = size[:, None] * share * np.cos(phase), size[:, None] * share * np.sin(phase)
        self._speed = speed * rng.uniform(0.5, 1.0) * rng.choice([-1.0, 1.0]) if gait == "trot" else 0.0
        self._side = 0.3 * speed * rng.uniform(-1.0, 1.0) if gait == "trot" else 0.0
        self._turn = 0.3 * rng.uniform(-1.0, 1.0) if gait == "trot" else 0.0
        self._spin = rng.uniform(0.4, 0.8) * rng.choice([-1.0, 1.0]) if gait == "turn" else 0.0

    def velocity(self, t: float) -> FloatArray:
        """Wanted velocity over the ground in the trunk's own direction and turning rate, shape (3,) [m/s, m/s, rad/s]."""
        blend = min(max(t / self._BLEND, 0.0), 1.0)
        wave = math.sin(2.0 * math.pi * 0.1 * t)
        return blend * np.array([self._speed, self._side * wave, self._turn * wave + self._spin])

    def sway(self, t: float) -> FloatArray:
        """Displacement of position [m] and roll, pitch, yaw [rad], shape (6,)."""
        u = min(max(t / self._BLEND, 0.0), 1.0)
        blend = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        phase = self._omega * t
        return np.asarray(blend * (self._sine @ np.sin(phase) + self._cosine @ np.cos(phase)))

    def reference(self, t: float, origin: FloatArray, yaw: float) -> TrunkReference:
        """Wanted motion at t around a place on the ground (2,) [m] and a heading [rad]."""
        if self.gait != "sway":
            still = np.zeros(3)
            place = np.array([origin[0], origin[1], self.height])
            return TrunkReference(rotation_of([0.0, 0.0, yaw]), place, still, still, still, still)
        h = _DIFFERENCE
        before, now, after = (self.sway(x) for x in (t - h, t, t + h))
        heading = np.array([0.0, 0.0, yaw])
        rotations = [rotation_of(x[3:] + heading) for x in (before, now, after)]
        turned = [_vector((b @ a.T - a @ b.T) / 2.0) / h for a, b in pairwise(rotations)]
        velocity = (after[:3] - before[:3]) / (2.0 * h)
        return TrunkReference(
            rotation=rotations[1],
            position=now[:3] + np.array([origin[0], origin[1], self.height]),
            velocity=velocity,
            acceleration=(after[:3] - 2.0 * now[:3] + before[:3]) / h**2,
            omega=(turned[0] + turned[1]) / 2.0,
            omega_dot=(turned[1] - turned[0]) / h,
        )


class Trot:
    """When the feet of a trot stand: diagonal pairs, each on the ground for more than half of the cycle.

    Args:
        feet: number of feet; pairs are 0 with 3 and 1 with 2. period: of the cycle [s]. duty: share of it that a foot stands.
    """

    def __init__(self, feet: int, period: float = 0.5, duty: float = 0.6) -> None:
        self.period, self.duty = period, duty
        self._offset = np.array([0.0, 0.5, 0.5, 0.0])[:feet]

    def phase(self, t: float) -> FloatArray:
        """Phase of each foot: 0 to 1 while it stands, 1 to 2 while it swings; before the begin all stand in the middle of it."""
        if t < 0.0:
            return np.full(self._offset.size, 0.5)
        phase = (t / self.period + 0.5 * self.duty + self._offset) % 1.0
        if t < self.period:
            # the pair that would start in the air stands until its first lift-off
            early = t / self.period + 0.5 * self.duty + self._offset
            phase = np.where((self._offset > 0.0) & (early < 1.0), np.minimum(phase, 0.5 * self.duty), phase)
        return np.where(phase < self.duty, phase / self.duty, 1.0 + (phase - self.duty) / (1.0 - self.duty))


def _vector(skew: FloatArray) -> FloatArray:
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
