"""BulletJoints: the movable joints of a body in PyBullet, as arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet

from sysid_ros.sample import FloatArray


class BulletJoints:
    """Joints under torque control, with PyBullet's own motors off.

    Args:
        body: in the world of ``client``.

    Attributes:
        names: of the n movable joints in PyBullet's order, that of all arrays here.
        links: index of each link by its name.
    """

    def __init__(self, body: int, client: int) -> None:
        self._body, self._client = body, client
        count = pybullet.getNumJoints(body, physicsClientId=client)
        infos = [pybullet.getJointInfo(body, j, physicsClientId=client) for j in range(count)]
        movable = [info for info in infos if info[2] != pybullet.JOINT_FIXED]
        self._joints = [int(info[0]) for info in movable]
        self.names: tuple[str, ...] = tuple(info[1].decode() for info in movable)
        self.links = {info[12].decode(): int(info[0]) for info in infos}

    def let_go(self) -> None:
        """Switch PyBullet's motors off."""
        self._command(pybullet.VELOCITY_CONTROL, np.zeros(len(self._joints)))

    def apply(self, tau: FloatArray) -> None:
        """Torques of the next step, shape (n,) [N m]."""
        self._command(pybullet.TORQUE_CONTROL, tau)

    def reset(self, q: FloatArray, v: Sequence[float] | FloatArray) -> None:
        """Put the joints somewhere, in motion: shapes (n,) [rad], [rad/s]."""
        for joint, position, velocity in zip(self._joints, q, v, strict=True):
            pybullet.resetJointState(self._body, joint, position, velocity, physicsClientId=self._client)

    def read(self) -> tuple[FloatArray, FloatArray]:
        """Position and velocity now, shape (n,) each [rad], [rad/s]."""
        states = pybullet.getJointStates(self._body, self._joints, physicsClientId=self._client)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def _command(self, mode: int, forces: FloatArray) -> None:
        pybullet.setJointMotorControlArray(self._body, self._joints, mode, forces=forces, physicsClientId=self._client)
