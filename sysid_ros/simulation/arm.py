"""ArmWorld: the arm and the body that it carries in PyBullet, in joint torque control."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.bullet_world import STEP, BulletWorld
from sysid_ros.simulation.carried_body import CarriedBody
from sysid_ros.simulation.payload import Payload
from sysid_ros.simulation.quiet_bullet import pybullet


class ArmWorld(BulletWorld):
    """A fixed-base arm under joint torques, and a rigid body that a fixed constraint ties to its tip link.

    Each step is ``v+ = v + h M(q)^-1 (tau - C(q, v) v - g(q)); q+ = q + h v+`` (PyBullet's semi-implicit Euler, Featherstone's
    algorithm). So the torque of step k agrees with the second difference of the positions *centred at k* to rounding, and q of
    the step's begin, the mean of the velocities before and after the step, and the torque all belong to the step's begin. What
    remains is that Coriolis torques use the velocity half a step earlier: some millinewton metres in fast motion. There is no
    collision shape, so nothing touches.

    Args:
        urdf: text of the arm's URDF, fixed at its base.
        tip: link that the body is tied to.
        gravity: shape (3,) [m/s^2].
        step: of the physics [s].

    Attributes:
        body: what is tied to the tip.
    """

    def __init__(self, urdf: str, tip: str, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81), step: float = STEP) -> None:
        super().__init__(gravity, step=step)
        self._period = step
        self._load(urdf, fixed=True)
        self.body = CarriedBody(self._client, self._robot, self.links[tip])
        self._read()

    def reset(self, q: FloatArray, v: FloatArray) -> None:
        """Put the joints into a state, shape (n,) each."""
        self._put(q, v)

    def step(self, tau: FloatArray) -> None:
        """Apply joint torques (n,) [N m] for one step."""
        self._step(tau)
        self.body.step(self._period)

    def pick(self, payload: Payload) -> None:
        """Tie a body to the tip; it appears there with the tip's own motion, so that the pick is no impact.

        A body that was dropped and still falls is taken out of the world.
        """
        # a tied body's velocity is J(q before the step) v; with J(q after it) the first torque would lack the centripetal part
        q, v = self.q, self.v
        self.reset(q - self._period * v, v)
        motion = self.body.motion_of(payload.com)
        self.reset(q, v)
        self.body.tie(payload, motion)

    def inverse_dynamics(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """PyBullet's own inverse dynamics of the arm without the body, shape (n,) [N m]."""
        return np.array(
            pybullet.calculateInverseDynamics(self._robot, q.tolist(), v.tolist(), a.tolist(), physicsClientId=self._client)
        )

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """PyBullet's own mass matrix of the arm without the body, shape (n, n) [kg m^2]."""
        return np.array(pybullet.calculateMassMatrix(self._robot, q.tolist(), physicsClientId=self._client))
