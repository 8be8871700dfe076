"""ArmWorld: the arm and the body that it carries in PyBullet, in joint torque control."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pybullet

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.bullet_joints import BulletJoints
from sysid_ros.simulation.carried_body import CarriedBody
from sysid_ros.simulation.payload import Payload

STEP = 1e-3
"""Step of the physics and of the torque control [s]."""


class ArmWorld:
    """A fixed-base arm under joint torques, and a rigid body that a fixed constraint ties to its tip link.

    Each step is ``v+ = v + h M(q)^-1 (tau - C(q, v) v - g(q)); q+ = q + h v+`` (PyBullet's semi-implicit Euler, Featherstone's
    algorithm). So the torque of step k agrees with the second difference of the positions *centred at k* to rounding, and q of
    the step's begin, the mean of the velocities before and after the step, and the torque all belong to the step's begin. What
    remains is that Coriolis torques use the velocity half a step earlier: some millinewton metres in fast motion.

    What PyBullet adds by itself is switched off: joint motors, joint damping (0.04 where a URDF states none), linear and angular
    damping. There is no collision shape, so nothing touches.

    Args:
        urdf: text of the arm's URDF, fixed at its base.
        tip: link that the body is tied to.
        gravity: shape (3,) [m/s^2].
        step: of the physics [s].

    Attributes:
        joint_names: movable joints, base to tip.
        q, v: state at the begin of the next step, shape (n,) [rad], [rad/s]; v is the velocity that led to q.
        body: what is tied to the tip.
    """

    def __init__(self, urdf: str, tip: str, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81), step: float = STEP) -> None:
        self._step = step
        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(*gravity, physicsClientId=self._client)
        # to rounding, not to the default threshold, which leaves some hundredths of a newton metre in the constraint that ties
        # the body
        pybullet.setPhysicsEngineParameter(fixedTimeStep=step, solverResidualThreshold=1e-30, physicsClientId=self._client)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_text(urdf)
            self._arm: int = pybullet.loadURDF(
                str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=self._client
            )
        self._joints = BulletJoints(self._arm, self._client)
        self.joint_names = self._joints.names
        for link in (-1, *self._joints.links.values()):
            pybullet.changeDynamics(
                self._arm, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=self._client
            )
        self._joints.let_go()
        self.body = CarriedBody(self._client, self._arm, self._joints.links[tip])
        self._read()

    def close(self) -> None:
        """Free the world; it can't be used any more. A second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    def reset(self, q: FloatArray, v: FloatArray) -> None:
        """Put the joints into a state, shape (n,) each."""
        self._joints.reset(q, v)
        self._read()

    def step(self, tau: FloatArray) -> None:
        """Apply joint torques (n,) [N m] for one step."""
        self._joints.apply(tau)
        pybullet.stepSimulation(physicsClientId=self._client)
        self._read()
        self.body.step(self._step)

    def pick(self, payload: Payload) -> None:
        """Tie a body to the tip; it appears there with the tip's own motion, so that the pick is no impact.

        A body that was dropped and still falls is taken out of the world.
        """
        # a tied body's velocity is J(q before the step) v; with J(q after it) the first torque would lack the centripetal part
        q, v = self.q, self.v
        self.reset(q - self._step * v, v)
        motion = self.body.motion_of(payload.com)
        self.reset(q, v)
        self.body.tie(payload, motion)

    def inverse_dynamics(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """PyBullet's own inverse dynamics of the arm without the body, shape (n,) [N m]."""
        return np.array(
            pybullet.calculateInverseDynamics(self._arm, q.tolist(), v.tolist(), a.tolist(), physicsClientId=self._client)
        )

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """PyBullet's own mass matrix of the arm without the body, shape (n, n) [kg m^2]."""
        return np.array(pybullet.calculateMassMatrix(self._arm, q.tolist(), physicsClientId=self._client))

    def _read(self) -> None:
        self.q, self.v = self._joints.read()
