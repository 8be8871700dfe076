"""Effect: one physical cause of joint torque, as regressor columns times parameters."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.arguments import carrying, of_slide, positive
from sysid_ros.effects.described import Described
from sysid_ros.effects.on_legs import OnLegs
from sysid_ros.effects.searched import Searched
from sysid_ros.effects.traits import Acts, Curve, Depends, Knob, Scope
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

__all__ = ["Acts", "Depends", "Effect", "JointCurves", "JointEffect", "Knob", "carrying", "positive"]


class Effect(Described, Searched, OnLegs):
    """One cause of torque, linear in its parameters: ``tau_effect = Y(q, v, a) theta``. What a search asks of it stands in
    :class:`sysid_ros.effects.searched.Searched`, what a description can hold of it in
    :class:`sysid_ros.effects.described.Described`, what is asked where it moves a robot on legs in
    :class:`sysid_ros.effects.on_legs.OnLegs`.

    A nonlinear knob (the width of a sign function, a frame) is a constructor argument; ``settings`` gives it back, so that an
    effect can be written to ``model.yaml`` and made again by :meth:`from_settings`.

    Attributes:
        id: the effect's name in files and messages.
        label: the effect in words.
        nonnegative: True where physics forbids negative parameters.
        robot: the model whose joint order the rows have.
        joints: indices of the joints that have parameters, ascending.
        parameter_names: p names.
        units: p units.
        signature: what it leaves in the residual of a model that lacks it.
        look_alikes: ids of the effects that it is mistaken for. separated_by: the motion that tells them apart.
        knobs: its nonlinear parameters.
        acts: where in the drive train its torque acts. depends_on: what its columns depend on beside the motion.
        family: effects of one family are forms of one thing, of which a joint has one; empty where it stands for itself.
        usual: how often a real arm's joint (or a real arm) has it so that it shows, before any data: a probability.
        jumps: True where its torque jumps when the velocity changes its sign.
        replaces_links: True where its parameters are the inertials of the links themselves, which then are not the URDF's.
        in_urdf: True where a URDF's ``<inertial>`` and ``<dynamics>`` hold all of it.
    """

    id: ClassVar[str]
    label: ClassVar[str]
    signature: ClassVar[str] = ""
    look_alikes: ClassVar[tuple[str, ...]] = ()
    separated_by: ClassVar[str] = ""
    knobs: ClassVar[tuple[Knob, ...]] = ()
    nonnegative: ClassVar[bool] = False
    acts: ClassVar[Acts] = Acts.DRIVE
    depends_on: ClassVar[frozenset[Depends]] = frozenset()
    family: ClassVar[str] = ""
    usual: ClassVar[float] = 0.05
    jumps: ClassVar[bool] = False
    replaces_links: ClassVar[bool] = False
    in_urdf: ClassVar[bool] = False
    parameter_names: tuple[str, ...]
    units: tuple[str, ...]

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        unknown = sorted(set(joints) - set(robot.joint_names))
        if unknown:
            raise ModelFileError(
                f"effect '{self.id}' names joints {', '.join(unknown)}; the robot has {', '.join(robot.joint_names)}."
            )
        self.robot = robot
        self.joints = np.array([i for i, name in enumerate(robot.joint_names) if not joints or name in joints], dtype=np.intp)

    def name_joints(self, symbols: Sequence[str], units: Sequence[str]) -> None:
        """Name the parameters: joint after joint, each with all of the symbols, in units as a revolute joint has them."""
        self.parameter_names = tuple(f"{symbol}[{name}]" for name in self.joint_names for symbol in symbols)
        self.units = tuple(of_slide(unit) if self.robot.is_prismatic[j] else unit for j in self.joints for unit in units)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameter_names)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints that have parameters."""
        return tuple(self.robot.joint_names[i] for i in self.joints)

    @property
    def nominal(self) -> FloatArray:
        """Its parameters as the URDF has them, shape (p,): what is expected of them before any data."""
        return np.zeros(self.p)

    @property
    def stated(self) -> FloatArray:
        """For an effect of one joint: how much of its parameters the torque of the URDF holds already, shape (p,). Less than that
        there may be."""
        return np.zeros(self.p)

    @property
    def nonnegative_rows(self) -> FloatArray:
        """What must not be negative, as rows times the parameters, shape (m, p): each of them where physics forbids it."""
        return np.eye(self.p) if self.nonnegative else np.zeros((0, self.p))

    @classmethod
    def from_settings(cls, robot: RobotModel, joints: Sequence[str], settings: dict[str, Any]) -> Effect:
        """The effect that ``settings`` describe."""
        return cls(robot, joints, **settings)

    @abstractmethod
    def fill(self, sample: Sample, out: FloatArray) -> None:
        """Write the columns into ``out`` of shape (n, p); entries that are always zero may be left alone.

        :meth:`RobotModel.rnea` has run on this sample just before.
        """

    # What compiled code can do without asking :meth:`fill` at every sample.

    def link_columns(self) -> FloatArray | None:
        """M, shape (10 n, p), where its columns are ``Y M`` with Y the regressor of all links; None of others."""
        return None

    def simple_curves(self) -> FloatArray | None:
        """Where each parameter times a :class:`.traits.Curve` is the torque of one joint: the curve, the width of the smoothed
        sign, and the joint of each, shape (p, 3); None of others."""
        return None

    @property
    def diagonal(self) -> JointEffect | None:
        """The effect itself where it has one parameter for each joint of the robot, whose column loads that joint alone."""
        return None

    def columns(self, sample: Sample) -> FloatArray:
        """Y of this effect, shape (n, p) [N m per unit of the parameter]."""
        self.robot.rnea(sample.q, sample.v, sample.a)
        out = np.zeros((self.robot.n, self.p))
        self.fill(sample, out)
        return out

    def columns_along(self, motion: Motion) -> FloatArray:
        """Y along a whole recording, shape (N, n, p). An effect with a memory computes it here, from the recording's start."""
        return np.stack([self.columns(sample) for sample in motion.samples()])

    def curves_along(self, motion: Motion) -> FloatArray:
        """Columns of an effect that loads one joint at a time, each on its own joint, shape (c, N, n)."""
        k = len(self.joints)
        own = self.columns_along(motion)[:, self.joints].reshape(len(motion.t), k, k, -1)
        out = np.zeros((own.shape[3], len(motion.t), self.robot.n))
        out[:, :, self.joints] = np.einsum("tjjc->ctj", own)
        return out

    def momentum_columns_along(self, motion: Motion) -> tuple[FloatArray, FloatArray] | None:
        """For an effect of inertia: columns P and R, shape (N, n, p) each, with ``Y = dP/dt + R``, neither of which needs an
        acceleration (Gautier, Briot, Venture 2013); None for one whose columns need none anyway."""
        return None

    def smoothed(self, width: float) -> Effect:
        """The effect with every jump at a reversal spread over ``width`` [rad/s], for searches by gradients; itself where it has
        none."""
        return self

    def add_spread(self, sample: Sample, directions: FloatArray, out: FloatArray) -> None:
        """Add ``Y directions`` to ``out``, shape (n, c): what errors of the parameters, directions of shape (p, c), do."""
        out += self.columns(sample) @ directions

    def torque(self, sample: Sample, theta: FloatArray) -> FloatArray:
        """Joint torques of this effect, shape (n,) [N m]: what a simulation adds at each step."""
        return self.columns(sample) @ theta

    def torque_along(self, motion: Motion, theta: FloatArray) -> FloatArray:
        """Joint torques along a whole recording, shape (N, n) [N m]."""
        return self.columns_along(motion) @ theta


class JointEffect(Effect):
    """An effect with one parameter a joint, whose column loads only that joint: ``tau_j = c(q_j, v_j, a_j) theta_j``."""

    scope: ClassVar[Scope] = Scope.JOINT
    alone: ClassVar[bool] = True
    symbol: ClassVar[str]
    unit: ClassVar[str]
    simple: ClassVar[Curve | None] = None
    """What its curve is, where compiled code knows it."""
    width: float = 1.0

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.name_joints((self.symbol,), (self.unit,))
        self._columns = np.arange(len(self.joints))

    def simple_curves(self) -> FloatArray | None:
        return None if self.simple is None else np.array([[self.simple, self.width, j] for j in self.joints]).reshape(-1, 3)

    @property
    def diagonal(self) -> JointEffect | None:
        return self if len(self.joints) == self.robot.n else None

    @abstractmethod
    def curve(self, sample: Sample | Motion) -> FloatArray:
        """c of every joint, shape (n,) [N m per unit of the parameter]; of a whole motion, shape (N, n) or one that fits it."""

    def per_joint(self, theta: FloatArray) -> FloatArray:
        """Its parameters as one value a joint of the robot, shape (n,), 0 where it has none."""
        out = np.zeros(self.robot.n)
        out[self.joints] = theta
        return out

    def curves_along(self, motion: Motion) -> FloatArray:
        return np.broadcast_to(self.curve(motion), motion.q.shape)[None]

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[self.joints, self._columns] = self.curve(sample)[self.joints]

    def columns_along(self, motion: Motion) -> FloatArray:
        out = np.zeros((len(motion.t), self.robot.n, self.p))
        out[:, self.joints, self._columns] = self.curves_along(motion)[0][:, self.joints]
        return out

    def torque_along(self, motion: Motion, theta: FloatArray) -> FloatArray:
        return _of_one_joint(self, motion, theta) if self.alone and self.p == 1 else super().torque_along(motion, theta)

    def add_spread(self, sample: Sample, directions: FloatArray, out: FloatArray) -> None:
        curve = self.curve(sample)
        if len(self.joints) == self.robot.n:
            out += curve[:, None] * directions
        else:
            out[self.joints] += curve[self.joints, None] * directions

    def torque(self, sample: Sample, theta: FloatArray) -> FloatArray:
        curve = self.curve(sample)
        if len(self.joints) == self.robot.n:
            return curve * theta
        tau = np.zeros(self.robot.n)
        tau[self.joints] = curve[self.joints] * theta
        return tau


class JointCurves(Effect):
    """An effect with a few parameters a joint, whose columns load only that joint: ``tau_j = sum_c C_c(q, v, a)_j theta_cj``.

    Parameters stand joint after joint, each with all of its ``symbols``.
    """

    scope: ClassVar[Scope] = Scope.JOINT
    alone: ClassVar[bool] = True
    symbols: ClassVar[tuple[str, ...]]
    symbol_units: ClassVar[tuple[str, ...]]

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.name_joints(self.symbols, self.symbol_units)

    def of_symbol(self, symbol: str, theta: FloatArray) -> FloatArray:
        """The parameters of one symbol as one value a joint of the robot, shape (n,), 0 where it has none."""
        out = np.zeros(self.robot.n)
        out[self.joints] = theta[self.symbols.index(symbol) :: len(self.symbols)]
        return out

    @abstractmethod
    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        """C of every joint, shape (c, n) or (c, N, n).

        Args:
            state: one sample or a whole motion. load: torque on the link side of the joints, as ``state.q`` [N m]; along a motion
                that of the drives where it depends on that.
        """

    def curves_along(self, motion: Motion) -> FloatArray:
        return self.curves(motion, motion.drive_torque if Depends.DRIVE in self.depends_on else motion.link_torque)

    def fill(self, sample: Sample, out: FloatArray) -> None:
        load = self.robot.rnea_along(sample.q[None], sample.v[None], sample.a[None])[0]
        self._place(self.curves(sample, load)[:, None, :], out[None])

    def columns_along(self, motion: Motion) -> FloatArray:
        out = np.zeros((len(motion.t), self.robot.n, self.p))
        self._place(self.curves_along(motion), out)
        return out

    def torque_along(self, motion: Motion, theta: FloatArray) -> FloatArray:
        one = self.alone and len(self.joints) == 1
        return _of_one_joint(self, motion, theta) if one else super().torque_along(motion, theta)

    def _place(self, curves: FloatArray, out: FloatArray) -> None:
        for k, j in enumerate(self.joints):
            for c in range(len(self.symbols)):
                out[:, j, k * len(self.symbols) + c] = curves[c][:, j]


def _of_one_joint(effect: JointEffect | JointCurves, motion: Motion, theta: FloatArray) -> FloatArray:
    """Torque of an effect of one joint which needs the channels of that joint alone, shape (N, n) [N m]."""
    (joint,) = effect.joints
    out = np.zeros((len(motion.t), effect.robot.n))
    out[:, joint] = theta @ effect.curves_along(motion.of_joint(joint))[:, :, 0]
    return out
