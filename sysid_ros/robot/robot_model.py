"""RobotModel: the one file that calls pinocchio's algorithms."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
import pinocchio as pin
from numba import njit

from sysid_ros.exceptions import RobotModelError, in_a_line
from sysid_ros.robot.flange import flange_of, last_joint
from sysid_ros.robot.inverse_dynamics import inverse_dynamics_along
from sysid_ros.robot.urdf import lock_joints, read_urdf, stated_armatures
from sysid_ros.sample import FloatArray


class RobotModel:
    """A fixed-base tree of revolute and prismatic joints, from a URDF.

    The equation it computes is ``tau = M(q) a + C(q, v) v + g(q)``, linear in the stacked link inertials ``pi``:
    ``tau = Y(q, v, a) pi`` (Atkeson, An, Hollerbach 1986). Joints that are not used are locked at 0.

    Attributes:
        name: the robot's name in the URDF.
        joint_names: the n joints in the model's order, base to tip: the joint order of the whole package.
        notes: one sentence each for what was locked, left out or is suspicious.
        position_lower, position_upper, velocity_limit, effort_limit: shape (n,), infinite where the URDF states none.
        is_prismatic, is_continuous: shape (n,), bool.
        body_names: the links that the joints move, one a joint, in the order of ``pi``.
        frame_names: every frame that a payload can be expressed in.
        default_frame: the link that the last joint of the arm moves, not that of its gripper (of several ends, the last link
            that all share). flange: the frame on it that tools are mounted in, see :func:`.flange.flange_of`.
        damping, friction: shape (n,), the URDF's ``<dynamics>`` [N m s/rad], [N m].

    Raises:
        RobotModelError: the URDF can't be parsed, has no movable joint, or a joint name is not in it.
    """

    def __init__(self, model: Any, urdf: str, notes: Sequence[str], joint_types: dict[str, str]) -> None:
        self.model = model
        self.data = model.createData()
        self._aside = model.createData()  # for questions that must not disturb what rnea() left
        self.urdf = urdf
        self.name: str = model.name
        self.joint_names: tuple[str, ...] = tuple(model.names[1:])
        self.n: int = model.nv
        self.gravity: FloatArray = np.array(model.gravity.linear)
        self.is_prismatic = np.array([joint_types[j] == "prismatic" for j in self.joint_names])
        self.is_continuous = np.array([joint_types[j] == "continuous" for j in self.joint_names])
        self.position_lower = np.where(self.is_continuous, -np.inf, model.lowerPositionLimit)
        self.position_upper = np.where(self.is_continuous, np.inf, model.upperPositionLimit)
        self.velocity_limit = _stated(model.upperVelocityLimit)
        self.effort_limit = _stated(model.upperEffortLimit)
        self.damping: FloatArray = np.array(model.damping)
        self.friction: FloatArray = np.array(model.upperDryFrictionLimit)
        bodies = {f.name: f for f in model.frames if f.type == pin.FrameType.BODY}
        self.frame_names: tuple[str, ...] = tuple(bodies)
        self.body_names: tuple[str, ...] = tuple(
            next(name for name, f in bodies.items() if f.parentJoint == j and f.placement.isIdentity())
            for j in range(1, model.njoints)
        )
        self.default_frame = self.body_names[last_joint(model, urdf) - 1]
        self.flange = flange_of(urdf, self.default_frame)
        self.notes: tuple[str, ...] = (*notes, *self._massless())
        self._pi: FloatArray = np.concatenate([model.inertias[j].toDynamicParameters() for j in range(1, model.njoints)])

    @classmethod
    def from_urdf(cls, urdf: str, joint_names: Sequence[str] = (), gravity: Sequence[float] = (0.0, 0.0, -9.81)) -> RobotModel:
        """The model of the URDF's text in which only ``joint_names`` move (empty: every movable joint).

        Args:
            urdf: the URDF itself, not its path.
            joint_names: the joints that stay movable, in any order; the others are locked at 0.
            gravity: shape (3,) [m/s^2], in the base frame.
        """
        types, mimic, prepared = read_urdf(urdf)
        try:
            full = pin.buildModelFromXML(prepared)
        except Exception as error:
            raise RobotModelError(
                f"the URDF can't be turned into a model: {in_a_line(error)}. Check it with check_urdf."
            ) from error
        movable = [name for name in full.names[1:] if name in types]
        wanted = list(joint_names) or [name for name in movable if name not in mimic]
        missing = sorted(set(wanted) - set(movable))
        if missing:
            raise RobotModelError(
                f"the URDF '{full.name}' has no movable joint named {', '.join(missing)}. "
                f"It has {', '.join(movable) or 'none at all'}. Check the URDF or the names in the messages."
            )
        if not wanted:
            raise RobotModelError(f"the URDF '{full.name}' has no movable joint. Give the URDF of the arm that moves.")
        if len(set(wanted)) < len(wanted):
            raise RobotModelError(f"joint names are repeated in {', '.join(wanted)}. Name each joint once.")
        locked = [name for name in full.names[1:] if name not in wanted]
        reduced = pin.buildModelFromXML(lock_joints(prepared, locked)) if locked else full
        reduced.gravity.linear = np.asarray(gravity, dtype=float)
        reduced.armature = stated_armatures(urdf, list(reduced.names)[1:])
        kinds = {"Joints of the URDF that are not used": set(locked) - mimic, "Mimic joints": set(locked) & mimic}
        listed = {what: [name for name in locked if name in some] for what, some in kinds.items()}
        notes = [f"{what} are locked at 0: {', '.join(some)}." for what, some in listed.items() if some]
        return cls(reduced, urdf, notes, types)

    @classmethod
    def for_messages(
        cls,
        urdf: str,
        message_names: Sequence[str],
        joint_names: Sequence[str] = (),
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
    ) -> RobotModel:
        """The model in which the joints move that the messages name (or ``joint_names`` among them).

        Raises:
            RobotModelError: messages and URDF have no joint in common, or the messages lack one of ``joint_names``.
        """
        types, mimic, _ = read_urdf(urdf)
        missing = sorted(set(joint_names) - set(message_names))
        if missing:
            raise RobotModelError(
                f"the messages lack joints {', '.join(missing)}; they name {', '.join(message_names)}. Correct joint_names."
            )
        wanted = list(joint_names) or [name for name in types if name in message_names and name not in mimic]
        if not wanted:
            raise RobotModelError(
                f"the messages name joints {', '.join(message_names) or 'none'}; the URDF has movable joints "
                f"{', '.join(types) or 'none'}. Give the URDF of the robot that published them (--urdf), or say "
                "which of the messages' joints are the URDF's, in its order: --joint-names NAME..."
            )
        return cls.from_urdf(urdf, wanted, gravity)

    def _massless(self) -> list[str]:
        empty = [self.body_names[j - 1] for j in range(1, self.model.njoints) if self.model.inertias[j].mass < 1e-9]
        return [f"Links without mass in the URDF: {', '.join(empty)}. What they weigh ends up in the payload."] if empty else []

    @property
    def pi(self) -> FloatArray:
        """The URDF's link inertials, shape (10 n,), a body of ``body_names`` after the other, about its joint frame."""
        return self._pi

    def with_links(self, change: FloatArray) -> RobotModel:
        """The same robot with ``change``, shape (10 n,), added to its link inertials."""
        other = copy(self)
        other.model = self.model.copy()
        other._pi = self._pi + change
        for j in np.flatnonzero(np.any(np.reshape(change, (-1, 10)) != 0.0, axis=1)):
            other.model.inertias[int(j) + 1] = pin.Inertia.FromDynamicParameters(other._pi[10 * j : 10 * j + 10])
        other.data, other._aside = other.model.createData(), other.model.createData()
        return other

    def frame_id(self, frame: str) -> int:
        """Pinocchio's index of a frame.

        Raises:
            RobotModelError: there is no such frame.
        """
        if frame not in self.frame_names:
            raise RobotModelError(f"the URDF '{self.name}' has no link named '{frame}'. It has {', '.join(self.frame_names)}.")
        return int(self.model.getFrameId(frame, pin.FrameType.BODY))

    def rnea(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Joint torques of the URDF's links, shape (n,) [N m]."""
        return np.array(pin.rnea(self.model, self.data, q, v, a))

    def gravity_torque(self, q: FloatArray) -> FloatArray:
        """Joint torques that hold the arm still, shape (n,) [N m]."""
        return np.array(pin.computeGeneralizedGravity(self.model, self.data, q))

    def regressor(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Y of all links, shape (n, 10 n): ``tau = Y pi``."""
        return np.array(self.newest_regressor(q, v, a))

    def newest_regressor(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """As :meth:`regressor`; the next call of either overwrites it."""
        Y: FloatArray = pin.computeJointTorqueRegressor(self.model, self.data, q, v, a)
        return Y if self.n > 1 else Y.reshape(1, -1)  # (10,) where n is 1

    def momentum_regressors(self, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Y_p and Y_r, shape (n, 10 n) each: ``tau = d/dt(Y_p pi) + Y_r pi``, with ``Y_p pi = M v`` and ``Y_r pi = g - C' v``.

        No acceleration is needed: with ``dM/dt = C + C'``, ``g - C' v = (C v + g) - dM/dt v``, and dM/dt along v is a central
        difference over 20 microseconds of motion.
        """
        kept, zero, step = np.array(self.model.gravity.linear), np.zeros(self.n), 1e-5
        self.model.gravity.linear = np.zeros(3)
        try:
            momentum, after, before = (self.regressor(at, zero, v) for at in (q, q + step * v, q - step * v))
        finally:
            self.model.gravity.linear = kept
        return momentum, self.regressor(q, v, zero) - (after - before) / (2.0 * step)

    def payload_regressor(self, q: FloatArray, v: FloatArray, a: FloatArray, frame: int) -> FloatArray:
        """Y of a body fixed to a frame (index from :meth:`frame_id`), shape (n, 10): ``J_frame' Y_body``, parameters in it."""
        pin.rnea(self.model, self.data, q, v, a)
        body = pin.frameBodyRegressor(self.model, self.data, frame)
        return np.asarray(pin.computeFrameJacobian(self.model, self.data, q, frame, pin.LOCAL).reshape(6, self.n).T @ body)

    def fill_payload_regressor(self, q: FloatArray, frame: int, out: FloatArray) -> None:
        """As :meth:`payload_regressor`, into ``out``, where :meth:`rnea` has just run on the same q, v, a (its body accelerations
        are used)."""
        body = pin.frameBodyRegressor(self.model, self.data, frame)
        jacobian = pin.computeFrameJacobian(self.model, self.data, q, frame, pin.LOCAL).reshape(6, self.n)  # (6,) of one joint
        _transposed_product(jacobian, body, out)

    def rnea_along(self, q: FloatArray, v: FloatArray, a: FloatArray, gravity: FloatArray | None = None) -> FloatArray:
        """:meth:`rnea` of a whole motion, shapes (N, n); with another gravity vector of shape (3,) where one is given."""
        return inverse_dynamics_along(self.model, q, v, a, self.model.gravity.linear if gravity is None else gravity)

    def link_torque_along(self, q: FloatArray, v: FloatArray, a: FloatArray, pi: FloatArray) -> FloatArray:
        """``Y pi`` of a whole motion for link inertials, or changes of them, that need not be bodies, shape (N, n) [N m]."""
        states = zip(q, v, a, strict=True)
        return np.array([pin.computeJointTorqueRegressor(self.model, self._aside, *state) @ pi for state in states]).reshape(
            q.shape
        )

    def gravity_regressor_along(self, q: FloatArray, gravity: FloatArray) -> FloatArray:
        """:meth:`regressor` at rest under another gravity of shape (3,), at positions of shape (N, n), shape (N, n, 10 n)."""
        kept, still = np.array(self.model.gravity.linear), np.zeros_like(q)
        self.model.gravity.linear = gravity
        try:
            return self.regressor_along(q, still, still)
        finally:
            self.model.gravity.linear = kept

    def regressor_along(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """:meth:`regressor` of a whole motion, shape (N, n, 10 n)."""
        out = np.empty((len(q), self.n, 10 * self.n))
        for i in range(len(q)):
            out[i] = pin.computeJointTorqueRegressor(self.model, self._aside, q[i], v[i], a[i])
        return out

    def rnea_derivatives_along(self, q: FloatArray, v: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives of the inverse dynamics by q, v and a (the mass matrix) along a motion, shape (N, n, n) each."""
        by_q, by_v, by_a = (np.empty((len(q), self.n, self.n)) for _ in range(3))
        for i in range(len(q)):
            by_q[i], by_v[i], by_a[i] = pin.computeRNEADerivatives(self.model, self._aside, q[i], v[i], a[i])
        upper = np.triu(by_a)
        return by_q, by_v, upper + np.swapaxes(np.triu(by_a, 1), 1, 2)

    def frame_jacobian_along(self, q: FloatArray, frame: int) -> FloatArray:
        """Linear part of the Jacobian of a frame's origin, in the base's axes, along a motion, shape (N, 3, n)."""
        out = np.empty((len(q), 3, self.n))
        for i in range(len(q)):
            out[i] = pin.computeFrameJacobian(self.model, self._aside, q[i], frame, pin.LOCAL_WORLD_ALIGNED).reshape(6, -1)[:3]
        return out

    def base_acceleration_columns(self, q: FloatArray) -> FloatArray:
        """Torque that the links cost per acceleration of the base along its axes, shape (n, 3) [N m s^2/m]: mass times the
        transposed Jacobian of the centre of mass. The base's own mass is on none of the joints."""
        jacobian = pin.jacobianCenterOfMass(self.model, self._aside, q, False)
        return np.array(float(self._aside.mass[0]) * jacobian.reshape(3, self.n).T)

    def base_acceleration_columns_of(self, q: FloatArray, frame: int, theta: FloatArray) -> FloatArray:
        """As :meth:`base_acceleration_columns`, of a body of ten parameters fixed to a frame: ``J_frame' [m; S(mc)] R``."""
        jacobian = pin.computeFrameJacobian(self.model, self._aside, q, frame, pin.LOCAL)
        pin.forwardKinematics(self.model, self._aside, q)
        to_frame = pin.updateFramePlacement(self.model, self._aside, frame).rotation.T
        m, x, y, z = theta[:4]
        lever = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.asarray((m * jacobian[:3].T + jacobian[3:].T @ lever) @ to_frame)

    def forward_dynamics(self, q: FloatArray, v: FloatArray, tau: FloatArray, rotor: FloatArray | None = None) -> FloatArray:
        """Accelerations of the URDF's links under joint torques, shape (n,) [rad/s^2].

        Args:
            rotor: inertia of the motors seen through the gears, shape (n,) [kg m^2].
        """
        kept = np.array(self.model.armature)
        if rotor is not None:
            self.model.armature = kept + rotor
        try:
            return np.array(pin.aba(self.model, self._aside, q, v, tau))
        finally:
            self.model.armature = kept

    def frame_placement(self, q: FloatArray, frame: str) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and origin (3,) [m] of a frame in the base."""
        pin.framesForwardKinematics(self.model, self.data, q)
        placement = self.data.oMf[self.frame_id(frame)]
        return np.array(placement.rotation), np.array(placement.translation)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _transposed_product(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    """``out = a' b``, for matrices that are too small for the price of a call of BLAS."""
    for i in range(a.shape[1]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[0]):
                total += a[k, i] * b[k, j]
            out[i, j] = total


def _stated(limit: Any) -> FloatArray:
    array = np.array(limit, dtype=float)
    return np.where((array <= 0.0) | (array > 1e12), np.inf, array)
