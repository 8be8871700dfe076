"""TrunkChannels: what an IMU recorded of a trunk; TrunkSetup: what is known to be otherwise of IMU and feet than it is said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sysid_ros.robot.rotation import rotation_by
from sysid_ros.sample import FloatArray, TrunkReading


def _three() -> FloatArray:
    return np.zeros(3)


@dataclass(frozen=True, slots=True)
class TrunkSetup:
    """By what IMU and feet differ from what URDF and settings say of them.

    Attributes:
        tilt: rotation vector by which the IMU is turned, in the axes of the trunk, shape (3,) [rad]. lever: how far it sits from
            its place, shape (3,) [m]. bias: of the specific force that it shows, in the axes that are said of it, shape (3,)
            [m/s^2]. delay: of all that it shows [s].
        radius: by how much farther below its frame each foot touches the ground, by the foot's name [m].
    """

    tilt: FloatArray = field(default_factory=_three)
    lever: FloatArray = field(default_factory=_three)
    bias: FloatArray = field(default_factory=_three)
    delay: float = 0.0
    radius: dict[str, float] = field(default_factory=dict)

    def __add__(self, other: TrunkSetup) -> TrunkSetup:
        radius = {name: self.radius.get(name, 0.0) + other.radius.get(name, 0.0) for name in {**self.radius, **other.radius}}
        delay = self.delay + other.delay
        return TrunkSetup(self.tilt + other.tilt, self.lever + other.lever, self.bias + other.bias, delay, radius)

    @property
    def rotation(self) -> FloatArray:
        """Matrix that takes what the IMU shows into the axes that are said of it, shape (3, 3)."""
        return rotation_by(self.tilt)

    def corrected(self, force: FloatArray) -> FloatArray:
        """What specific forces that are shown are in truth, shape (..., 3)."""
        return np.asarray((force - self.bias) @ self.rotation.T)


@dataclass(frozen=True, slots=True)
class TrunkChannels:
    """What an IMU and contact sensors recorded, at the stamps of the joints, in the axes of the trunk.

    Attributes:
        omega: angular velocity, shape (N, 3) [rad/s]. force: specific force where the IMU sits, shape (N, 3) [m/s^2].
        place: of the IMU in the trunk, shape (3,) [m]. contacts: 1.0 for each foot that stands, shape (N, k); None where no
            message tells.
    """

    omega: FloatArray
    force: FloatArray
    place: FloatArray
    contacts: FloatArray | None = None

    @classmethod
    def of(cls, readings: Sequence[TrunkReading]) -> TrunkChannels:
        """The channels of readings one by one; contacts only where all of them have some."""
        contacts = [r.contacts for r in readings if r.contacts is not None]
        return cls(
            np.stack([r.omega for r in readings]),
            np.stack([r.force for r in readings]),
            readings[-1].place,
            np.stack(contacts) if len(contacts) == len(readings) else None,
        )

    def at(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp]) -> TrunkChannels:
        """The readings of some rows, in their order."""
        contacts = None if self.contacts is None else self.contacts[rows]
        return TrunkChannels(self.omega[rows], self.force[rows], self.place, contacts)

    def corrected(self, t: FloatArray, setup: TrunkSetup) -> TrunkChannels:
        """What the IMU would have shown were it as it is said to be, given what is known to be otherwise; ``t``: (N,) [s]."""
        omega, force = self.omega, self.force
        if setup.delay:
            omega, force = (np.stack([np.interp(t + setup.delay, t, x[:, i]) for i in range(3)], axis=1) for x in (omega, force))
        return TrunkChannels(omega @ setup.rotation.T, setup.corrected(force), self.place + setup.lever, self.contacts)
