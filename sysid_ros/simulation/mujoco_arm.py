"""An arm in MuJoCo: the MJCF of a model, with the joints' damping set at each step."""

from __future__ import annotations

import mujoco
import numpy as np

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.mjcf import without_log
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.held_motion import STEP
from sysid_ros.torque.mjcf_export import mjcf
from sysid_ros.torque.torque_model import TorqueModel

_LEAST = 1e-6
"""Inertia of a joint that has none [kg m^2]."""


class MujocoArm:
    """As :class:`sysid_ros.simulation.held_motion.Arm`, by MuJoCo's ``implicitfast`` integrator; J is its ``armature``.

    Its ``frictionloss`` is switched off: dry friction is among the torques along the recorded motion.

    Raises:
        RobotModelError: MuJoCo does not take the model.
    """

    def __init__(self, known: TorqueModel) -> None:
        robot = known.robot
        without_log(mujoco)
        spec = mujoco.MjSpec.from_string(mjcf(known))
        # of a URDF whose inertias violate the triangle inequality; the exact ones are set below
        spec.compiler.balanceinertia = True
        spec.option.timestep = STEP
        try:
            self._model = spec.compile()
        except ValueError as error:
            raise RobotModelError(f"MuJoCo does not take the model: {' '.join(str(error).split())}.") from error
        for name, theta in zip(robot.body_names, known.links().reshape(-1, 10), strict=True):
            self._set_inertia(self._model.body(name).id, theta)
        self._model.dof_frictionloss[:] = 0.0
        joints = [self._model.joint(name).id for name in robot.joint_names]
        self._at, self._dofs = self._model.jnt_qposadr[joints], self._model.jnt_dofadr[joints]
        own = np.diagonal(known.mass_along(np.zeros((1, robot.n)))[0]) + known.armature()
        # a joint without any inertia, as of a point on its axis, can't be simulated
        self._model.dof_armature[self._dofs] += np.where(own < _LEAST, _LEAST, 0.0)
        self._data = mujoco.MjData(self._model)
        mujoco.mj_setConst(self._model, self._data)
        self.q, self.v = np.zeros(robot.n), np.zeros(robot.n)

    def _set_inertia(self, body: int, theta: FloatArray) -> None:
        mass, com, inertia = inertial_parameters.to_com(theta)
        if mass > 0.0:
            principal, axes = np.linalg.eigh(inertia)
            axes[:, 2] *= np.sign(np.linalg.det(axes))
            mujoco.mju_mat2Quat(self._model.body_iquat[body], axes.ravel())
            self._model.body_mass[body], self._model.body_inertia[body], self._model.body_ipos[body] = mass, principal, com

    def reset(self, q: FloatArray, v: FloatArray) -> None:
        """Put the joints into a state, shape (n,) each."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[self._at], self._data.qvel[self._dofs] = q, v
        self.q, self.v = np.array(q), np.array(v)

    def step(self, tau: FloatArray, damping: FloatArray) -> None:
        """One step under joint torques tau [N m] and damping [N m s/rad], shape (n,) each."""
        self._model.dof_damping[self._dofs] = damping
        self._data.qfrc_applied[self._dofs] = tau
        mujoco.mj_step(self._model, self._data)
        self.q, self.v = self._data.qpos[self._at], self._data.qvel[self._dofs]

    def close(self) -> None:
        """Nothing: MuJoCo frees itself."""


make = MujocoArm
