"""QuadrupedWorld: a legged robot on a plane and the box on its back in PyBullet, in joint torque control; Hoist: its ropes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sysid_ros.robot.rotation import quaternion
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.bullet_world import STEP, BulletWorld
from sysid_ros.simulation.carried_body import CarriedBody
from sysid_ros.simulation.quiet_bullet import pybullet
from sysid_ros.simulation.trunk_state import TrunkState, cross

_ON_A_FOOT = 3.0
"""Mass by which soft ground is damped [kg], a quarter of the robot's."""


class QuadrupedWorld(BulletWorld):
    """A floating trunk on legs whose feet may touch a plane, and a rigid body that a fixed constraint ties to the trunk.

    Each step is ``v+ = v + h M(q)^-1 (S' tau + J' f - C(q, v) v - g(q)); q+ = q + h v+`` (PyBullet's semi-implicit Euler) with
    the contact forces f that keep the feet out of the ground and within the friction cone. So torque, force and the difference of
    velocities of a step belong together at its begin, as in :class:`sysid_ros.simulation.arm.ArmWorld`. Nothing but the feet
    touches.

    Args:
        urdf: text of the robot's URDF, whose root is the trunk. feet: links that touch, spheres.
        normal: of the plane through the world's origin, shape (3,), upwards. friction: Coulomb coefficient of the feet.
        stiffness: of the ground under a foot [N/m], which is damped without an overshoot; infinite: it is hard.

    Attributes:
        trunk: the trunk at the begin of the next step.
        foot_forces: of the ground on the feet in the last step, in the world, shape (k, 3) [N].
        body: what is tied to the trunk.
    """

    def __init__(
        self, urdf: str, feet: Sequence[str], normal: FloatArray, friction: float = 0.8, stiffness: float = math.inf
    ) -> None:
        super().__init__((0.0, 0.0, -9.81), iterations=100)
        client = self._client
        shape = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=normal.tolist(), physicsClientId=client)
        self._ground = pybullet.createMultiBody(0.0, shape, physicsClientId=client)
        pybullet.changeDynamics(self._ground, -1, lateralFriction=1.0, restitution=0.0, physicsClientId=client)
        if math.isfinite(stiffness):
            damping = 2.0 * math.sqrt(_ON_A_FOOT * stiffness)
            pybullet.changeDynamics(self._ground, -1, contactStiffness=stiffness, contactDamping=damping, physicsClientId=client)
        self._load(urdf, False, lateralFriction=friction, rollingFriction=0.0, spinningFriction=0.0, restitution=0.0)
        self._feet = [self.links[name] for name in feet]
        com = pybullet.getDynamicsInfo(self._robot, -1, physicsClientId=client)
        self._com, self._com_rotation = np.array(com[3]), _matrix(com[4])
        self.body = CarriedBody(client, self._robot, -1)
        self.foot_forces: FloatArray = np.zeros((len(feet), 3))
        self._read()

    def reset(self, rotation: FloatArray, position: FloatArray, q: FloatArray) -> None:
        """Put trunk (3, 3), (3,) and joints (n,) at rest somewhere."""
        com = position + rotation @ self._com
        turn = quaternion(rotation @ self._com_rotation)
        pybullet.resetBasePositionAndOrientation(self._robot, com.tolist(), turn, physicsClientId=self._client)
        pybullet.resetBaseVelocity(self._robot, [0.0] * 3, [0.0] * 3, physicsClientId=self._client)
        self._put(q, np.zeros_like(q))

    def step(self, tau: FloatArray) -> None:
        """Apply joint torques (n,) [N m] for one step."""
        self._step(tau)
        self._read_contacts()
        self.body.step(STEP)

    def push(self, point: FloatArray, force: FloatArray) -> None:
        """Apply a force (3,) [N] at a point (3,) of the trunk, both in the world, during the next step."""
        pybullet.applyExternalForce(
            self._robot, -1, force.tolist(), point.tolist(), pybullet.WORLD_FRAME, physicsClientId=self._client
        )

    def _read(self) -> None:
        super()._read()
        com, turn = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self._client)
        velocity, omega = pybullet.getBaseVelocity(self._robot, physicsClientId=self._client)
        rotation = _matrix(turn) @ self._com_rotation.T
        lever = rotation @ self._com
        w = np.array(omega)
        self.trunk = TrunkState(rotation, np.array(com) - lever, np.array(velocity) - cross(w, lever), w)

    def _read_contacts(self) -> None:
        forces = np.zeros((len(self._feet), 3))
        for point in pybullet.getContactPoints(self._robot, self._ground, physicsClientId=self._client):
            if point[3] in self._feet:
                i = self._feet.index(point[3])
                forces[i] += point[9] * np.array(point[7]) + point[10] * np.array(point[11]) + point[12] * np.array(point[13])
        self.foot_forces = forces


def _matrix(quaternion: Sequence[float]) -> FloatArray:
    return np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)


_CORNERS = np.array([[0.15, 0.1, 0.0], [0.15, -0.1, 0.0], [-0.15, 0.1, 0.0], [-0.15, -0.1, 0.0]])
_STIFFNESS, _DAMPING = 1500.0, 120.0
_HEIGHT = 0.14
_RAMP = 0.5


class Hoist:
    """Springs and dampers from the trunk's corners to where they were when it began, raised and lowered::

        f_i = s(t) (k (p_i(t0) + h(t) e_z - p_i) - d v_i)

    with s the tautness and h the height. It takes half a second to become taut, half a second to lift, and as long to undo both.

    Args:
        world: where the robot is. begin, end: when the lifting begins and when the robot is free again [s].
    """

    def __init__(self, world: QuadrupedWorld, begin: float, end: float) -> None:
        self._world, self.begin, self.end = world, begin, end
        self._from: FloatArray | None = None

    def active(self, t: float) -> bool:
        """True between begin and end."""
        return self.begin <= t < self.end

    def pull(self, t: float) -> None:
        """Apply the forces of the step at t [s]."""
        if not self.active(t):
            return
        trunk = self._world.trunk
        points = trunk.position + _CORNERS @ trunk.rotation.T
        if self._from is None:
            self._from = points
        left = min(t - self.begin, self.end - t)
        taut, raised = min(left / _RAMP, 1.0), min(max(left / _RAMP - 1.0, 0.0), 1.0)
        wanted = self._from + np.array([0.0, 0.0, _HEIGHT * raised])
        for corner, point, goal in zip(_CORNERS, points, wanted, strict=True):
            force = taut * (_STIFFNESS * (goal - point) - _DAMPING * trunk.velocity_of(corner))
            self._world.push(point, force)
