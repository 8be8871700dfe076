"""BulletWorld: a robot in PyBullet under joint torques, with all that PyBullet adds by itself switched off."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.quiet_bullet import pybullet

STEP = 1e-3
"""Step of the physics and of the torque control [s]."""


class BulletWorld:
    """A world of its own for one robot in joint torque control.

    Joint motors, joint damping (0.04 where a URDF states none), linear and angular damping are off.

    Args:
        gravity: shape (3,) [m/s^2]. iterations: of the solver a step at most. step: of the physics [s].

    Attributes:
        joint_names: n movable joints in PyBullet's order, that of all arrays here.
        links: index of each link by its name.
        q, v: of the joints at the begin of the next step, shape (n,) [rad], [rad/s]; v is the velocity that led to q.
    """

    def __init__(self, gravity: Sequence[float], iterations: int = 50, step: float = STEP) -> None:
        self._client = client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(*gravity, physicsClientId=client)
        # to rounding, not to the default threshold, which leaves some hundredths of a newton metre in constraints
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=step, numSolverIterations=iterations, solverResidualThreshold=1e-30, physicsClientId=client
        )

    def _load(self, urdf: str, fixed: bool, **dynamics: float) -> None:
        """Put the robot of a URDF's text there, its base fixed or free, its links with more ``dynamics`` of PyBullet's."""
        client = self._client
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(urdf)
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE
            self._robot: int = pybullet.loadURDF(str(path), useFixedBase=fixed, flags=flags, physicsClientId=client)
        count = pybullet.getNumJoints(self._robot, physicsClientId=client)
        infos = [pybullet.getJointInfo(self._robot, j, physicsClientId=client) for j in range(count)]
        movable = [info for info in infos if info[2] != pybullet.JOINT_FIXED]
        self._joints = [int(info[0]) for info in movable]
        self.joint_names: tuple[str, ...] = tuple(info[1].decode() for info in movable)
        self.links = {info[12].decode(): int(info[0]) for info in infos}
        for link in (-1, *self.links.values()):
            still: dict[str, Any] = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": 0.0}
            pybullet.changeDynamics(self._robot, link, **still, **dynamics, physicsClientId=client)
        self._command(pybullet.VELOCITY_CONTROL, np.zeros(len(movable)))

    def close(self) -> None:
        """Free the world; it can't be used any more. A second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(self._client)
            self._client = -1

    def _step(self, tau: FloatArray) -> None:
        """Apply joint torques (n,) [N m] for one step."""
        self._command(pybullet.TORQUE_CONTROL, tau)
        pybullet.stepSimulation(physicsClientId=self._client)
        self._read()

    def _command(self, mode: int, forces: FloatArray) -> None:
        pybullet.setJointMotorControlArray(self._robot, self._joints, mode, forces=forces, physicsClientId=self._client)

    def _put(self, q: FloatArray, v: FloatArray) -> None:
        """Put the joints somewhere, in motion, shape (n,) each."""
        for joint, position, velocity in zip(self._joints, q, v, strict=True):
            pybullet.resetJointState(self._robot, joint, position, velocity, physicsClientId=self._client)
        self._read()

    def _read(self) -> None:
        states = pybullet.getJointStates(self._robot, self._joints, physicsClientId=self._client)
        self.q, self.v = np.array([state[0] for state in states]), np.array([state[1] for state in states])
