"""By how much more than gravity an accelerometer shows on the average: a bias of it, where gravity is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.robot.rotation import rotation_by
from sysid_ros.sample import FloatArray
from sysid_ros.signals.trunk_channels import TrunkChannels

_WINDOW = 4.0
"""Some steps, and so short that the gyro's own bias of 0.01 rad/s turns nothing by more than a degree or two [s]."""
_LEAST = 3e-3
"""By which the mean is wrong at least, turned by the gyro's bias and with gravity as well known as it is [m/s^2]."""


@dataclass(frozen=True, slots=True)
class ShownGravity:
    """What an accelerometer shows beside its motion.

    Attributes:
        up: mean direction of what it shows, in the axes of the trunk, shape (3,). excess: over gravity [m/s^2]. std: of that.
    """

    up: FloatArray
    excess: float
    std: float

    def bias(self, usual: float) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation of a bias, shape (3,) each [m/s^2], of which this is known and that it is ``usual``."""
        spread = np.sqrt(usual**2 * (1.0 - self.up**2) + self.std**2 * self.up**2)
        return self.excess * self.up, spread


def shown_gravity(recordings: Sequence[tuple[FloatArray, TrunkChannels]], gravity: float) -> ShownGravity | None:
    """From stamps (N,) [s] and channels of recordings on the ground; None where none lasts for two windows.

    In axes that the gyro carries along, the specific force is ``dv/dt - g``, and dv/dt has next to no mean over a smooth window
    of some steps, which begins and ends with weight zero. So the length of the mean is gravity's, and what it is more is the
    bias along it.
    """
    means: list[FloatArray] = []
    ups: list[FloatArray] = []
    for t, trunk in recordings:
        period = float(np.median(np.diff(t)))
        count = round(_WINDOW / period)
        weight = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
        weight /= weight.sum()
        for first in range(0, len(t) - count + 1, count // 2):
            part = slice(first, first + count)
            if t[first + count - 1] - t[first] > 1.2 * _WINDOW:
                continue
            means.append(weight @ _carried(trunk.omega[part], trunk.force[part], period))
            ups.append(trunk.force[part].mean(axis=0))
    if len(means) < 2:
        return None
    size = np.linalg.norm(np.array(means), axis=1) - gravity
    up = np.mean(ups, axis=0)
    # windows overlap by half
    std = float(np.std(size, ddof=1)) * (2.0 / len(size)) ** 0.5
    return ShownGravity(up / np.linalg.norm(up), float(size.mean()), float(np.hypot(std, _LEAST)))


def _carried(omega: FloatArray, force: FloatArray, period: float) -> FloatArray:
    """Vectors (M, 3) in axes that rest in the world, by angular velocities (M, 3) [rad/s]."""
    rotation, out = np.eye(3), np.empty_like(force)
    for i, (w, f) in enumerate(zip(omega, force, strict=True)):
        out[i] = rotation @ f
        rotation = rotation @ rotation_by(period * w)
    return out
