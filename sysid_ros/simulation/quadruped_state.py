"""QuadrupedState: what the sensors of a robot on legs tell at one instant."""

from __future__ import annotations

from dataclasses import dataclass

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class QuadrupedState:
    """What the sensors of the quadruped would tell at one instant.

    Attributes:
        t: [s]. q, v, tau: of the joints in the model's order, shape (n,).
        orientation: of the IMU in the world, quaternion x, y, z, w. omega: shape (3,) [rad/s], specific_force: shape (3,)
            [m/s^2], both in the axes of the IMU.
        contacts: 1.0 for each foot that touches, shape (k,). forces: of the ground on the feet in the trunk's axes, (k, 3) [N].
    """

    t: float
    q: FloatArray
    v: FloatArray
    tau: FloatArray
    orientation: FloatArray
    omega: FloatArray
    specific_force: FloatArray
    contacts: FloatArray
    forces: FloatArray
