"""TrunkState: where the trunk of a simulated robot on legs is and how it moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class TrunkState:
    """Where the trunk is and how it moves.

    Attributes:
        rotation: from the trunk's axes to the world's, shape (3, 3). position: of its origin, shape (3,) [m].
        velocity: of its origin, in the world, shape (3,) [m/s]. omega: angular velocity in the world, shape (3,) [rad/s].
    """

    rotation: FloatArray
    position: FloatArray
    velocity: FloatArray
    omega: FloatArray

    def velocity_of(self, point: FloatArray) -> FloatArray:
        """Velocity in the world of a point given in the trunk, shape (3,) [m/s]."""
        return self.velocity + cross(self.omega, self.rotation @ point)


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of two vectors (3,): numpy's own takes longer than a step of the physics allows."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
