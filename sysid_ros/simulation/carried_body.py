"""CarriedBody: a rigid body that a fixed constraint ties to a link of a robot in PyBullet."""

from __future__ import annotations

from typing import Any

import numpy as np

from sysid_ros.robot.rotation import quaternion
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.payload import Payload
from sysid_ros.simulation.quiet_bullet import pybullet

_FALL_TIME = 1.0
_NO_SLIP_FORCE = 1e6


Motion = tuple[FloatArray, Any, FloatArray, Any]
"""Position (3,), orientation, velocity (3,) and angular velocity in the world."""


class CarriedBody:
    """Ties a :class:`Payload` to a link and lets it go.

    Args:
        client: PyBullet's number of the world. robot: of the robot. link: of the link, -1 for the base.
    """

    def __init__(self, client: int, robot: int, link: int) -> None:
        self._client, self._robot, self._link = client, robot, link
        self._body: int | None = None
        self._constraint: int | None = None
        self._fallen = 0.0

    @property
    def tied(self) -> bool:
        return self._constraint is not None

    def tie(self, payload: Payload, moving: Motion | None = None) -> None:
        """Tie a body to the link; it appears there with the link's own motion, so that this is no impact.

        Args:
            moving: takes velocity and omega from there, of :meth:`motion_of` in another state.
        """
        self.untie(remove=True)
        com_world, link_orientation, velocity, omega = self.motion_of(payload.com)
        if moving is not None:
            _, _, velocity, omega = moving
        moments, axes = payload.principal()
        body_orientation = quaternion(axes)
        # the body's frame is put at its centre of mass along its principal axes, where PyBullet keeps its state anyway
        _, orientation = pybullet.multiplyTransforms([0.0] * 3, link_orientation, [0.0] * 3, body_orientation)
        body: int = pybullet.createMultiBody(payload.mass, -1, -1, com_world.tolist(), orientation, physicsClientId=self._client)
        pybullet.changeDynamics(
            body, -1, linearDamping=0.0, angularDamping=0.0, localInertiaDiagonal=moments.tolist(), physicsClientId=self._client
        )
        pybullet.resetBaseVelocity(body, velocity.tolist(), omega, physicsClientId=self._client)
        dynamics = pybullet.getDynamicsInfo(self._robot, self._link, physicsClientId=self._client)
        # frames of a constraint count from the centres of mass; both meet in the link's origin
        parent_position, parent_orientation = pybullet.invertTransform(dynamics[3], dynamics[4])
        child_position, child_orientation = pybullet.invertTransform(payload.com.tolist(), body_orientation)
        self._constraint = pybullet.createConstraint(
            self._robot, self._link, body, -1, pybullet.JOINT_FIXED, [0.0] * 3, parent_position, child_position,
            parent_orientation, child_orientation, physicsClientId=self._client,
        )  # fmt: skip
        pybullet.changeConstraint(self._constraint, maxForce=_NO_SLIP_FORCE, physicsClientId=self._client)
        self._body = body

    def untie(self, remove: bool = False) -> None:
        """Let the body go: it falls freely and is taken out of the world a second later, or at once."""
        if self._constraint is not None:
            pybullet.removeConstraint(self._constraint, physicsClientId=self._client)
            self._constraint = None
            self._fallen = 0.0
        if remove and self._body is not None:
            pybullet.removeBody(self._body, physicsClientId=self._client)
            self._body = None

    def step(self, period: float) -> None:
        """To be called after every step of the physics [s]: takes a fallen body away."""
        if self._body is not None and self._constraint is None:
            self._fallen += period
            if self._fallen > _FALL_TIME:
                self.untie(remove=True)

    def slip(self, payload: Payload) -> float:
        """How far the tied body has moved away from its place at the link [m]: the constraint's own error."""
        position, _ = pybullet.getBasePositionAndOrientation(self._body, physicsClientId=self._client)
        return float(np.linalg.norm(np.array(position) - self.motion_of(payload.com)[0]))

    def motion_of(self, point: FloatArray) -> Motion:
        """Position (3,) of a point given in the link's frame, the link's orientation, the point's velocity (3,), and omega."""
        if self._link < 0:
            com, com_orientation = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self._client)
            velocity, omega = pybullet.getBaseVelocity(self._robot, physicsClientId=self._client)
            inertial = pybullet.getDynamicsInfo(self._robot, -1, physicsClientId=self._client)
            frame = pybullet.multiplyTransforms(com, com_orientation, *pybullet.invertTransform(inertial[3], inertial[4]))
            link_com, origin, orientation, com_velocity = com, frame[0], frame[1], velocity
        else:
            link = pybullet.getLinkState(
                self._robot, self._link, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=self._client
            )
            link_com, origin, orientation, com_velocity, omega = link[0], link[4], link[5], link[6], link[7]
        rotation = np.array(pybullet.getMatrixFromQuaternion(orientation)).reshape(3, 3)
        position = np.array(origin) + rotation @ point
        return position, orientation, np.array(com_velocity) + np.cross(omega, position - np.array(link_com)), omega
