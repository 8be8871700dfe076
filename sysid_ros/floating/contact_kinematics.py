"""ContactKinematics: where the feet are and how the joints move them, by pinocchio's algorithms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


class ContactKinematics:
    """Positions, Jacobians and accelerations of some links, in the axes of the base.

    Args:
        robot: the model. frames: names of k links that it has. offsets: points of the links, in their axes, shape (k, 3) [m];
            None: their origins.

    Attributes:
        offsets: as given. joints_above: number of joints between the base and each link.
        carriers: those that move each link, shape (k, n), bool.
    """

    def __init__(self, robot: RobotModel, frames: Sequence[str], offsets: FloatArray | None = None) -> None:
        self.offsets = np.zeros((len(frames), 3)) if offsets is None else offsets
        self._shifted = bool(self.offsets.any())
        self._model, self._data, self._n = robot.model, robot.model.createData(), robot.n
        self.frames = tuple(frames)
        self._ids = [robot.frame_id(name) for name in frames]
        self.joints_above = tuple(len(self._model.supports[self._model.frames[i].parentJoint]) - 1 for i in self._ids)

        self.carriers = np.zeros((len(frames), self._n), dtype=np.bool_)
        for i, frame in enumerate(self._ids):
            for joint in list(self._model.supports[self._model.frames[frame].parentJoint])[1:]:
                self.carriers[i, self._model.joints[joint].idx_v] = True

    def origins(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The points, shape (k, 3) [m], and velocity and angular velocity that each joint gives to a body around the base's
        origin, shape (6, n). A point p of a link that joint j carries has the Jacobian ``v_j + w_j x p``."""
        motions = pin.computeJointJacobians(self._model, self._data, q)
        origins = np.empty((len(self._ids), 3))
        for i, frame in enumerate(self._ids):
            placement = pin.updateFramePlacement(self._model, self._data, frame)
            origins[i] = placement.act(self.offsets[i]) if self._shifted else placement.translation
        return origins, np.ascontiguousarray(motions)

    def axes(self) -> FloatArray:
        """Axes of the links in those of the base, shape (k, 3, 3), where :meth:`origins` was asked last."""
        return np.array([self._data.oMf[i].rotation for i in self._ids])

    def whole_accelerations(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Accelerations of the points and angular ones of their links, shape (k, 6) [m/s^2], [rad/s^2], for states (n,)."""
        pin.forwardKinematics(self._model, self._data, q, v, a)
        out = np.empty((len(self._ids), 6))
        for i, frame in enumerate(self._ids):
            both = pin.getFrameClassicalAcceleration(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)
            out[i] = both.vector
            if self._shifted:
                lever = pin.updateFramePlacement(self._model, self._data, frame).rotation @ self.offsets[i]
                w = pin.getFrameVelocity(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED).angular
                out[i, :3] += np.cross(both.angular, lever) + np.cross(w, np.cross(w, lever))
        return out

    def jacobians(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Origins, shape (k, 3) [m], and Jacobians of velocity and angular velocity, shape (k, 6, n), at q (n,)."""
        pin.computeJointJacobians(self._model, self._data, q)
        origins, jacobians = np.empty((len(self._ids), 3)), np.empty((len(self._ids), 6, self._n))
        for i, frame in enumerate(self._ids):
            origins[i] = pin.updateFramePlacement(self._model, self._data, frame).translation
            jacobians[i] = pin.getFrameJacobian(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)
        return origins, jacobians

    def accelerations(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Accelerations of the origins, shape (k, 3) [m/s^2], for joint states of shape (n,)."""
        pin.forwardKinematics(self._model, self._data, q, v, a)
        return np.array(
            [pin.getFrameClassicalAcceleration(self._model, self._data, i, pin.LOCAL_WORLD_ALIGNED).linear for i in self._ids]
        )

    @staticmethod
    def ends(robot: RobotModel) -> tuple[str, ...]:
        """Of every joint that carries no other, the link that is farthest from it."""
        model = robot.model
        bodies = [f for f in model.frames if f.type == pin.FrameType.BODY]
        ends = [j for j in range(1, model.njoints) if len(model.children[j]) == 0]
        hanging = [[f for f in bodies if f.parentJoint == j] for j in ends]
        return tuple(max(links, key=lambda f: float(np.linalg.norm(f.placement.translation))).name for links in hanging)

    @staticmethod
    def mass_of_base(robot: RobotModel) -> float:
        """Mass of all that is fixed to the root link [kg]."""
        return float(robot.model.inertias[0].mass)

    @staticmethod
    def leg_lengths(robot: RobotModel) -> list[int]:
        """Of every joint that carries no other, the number of joints from the first one on that only it hangs on."""
        model = robot.model
        chains = [list(model.supports[j])[1:] for j in range(1, model.njoints) if len(model.children[j]) == 0]
        return [sum(all(j not in other for other in chains if other is not chain) for j in chain) for chain in chains]
