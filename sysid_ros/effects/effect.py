"""Effect: one physical cause of joint torque, as regressor columns times parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample


class Effect(ABC):
    """One cause of torque, linear in its parameters: ``tau_effect = Y(q, v, a) theta``.

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
    """

    id: ClassVar[str]
    label: ClassVar[str]
    nonnegative: ClassVar[bool] = False
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

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameter_names)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints that have parameters."""
        return tuple(self.robot.joint_names[i] for i in self.joints)

    @property
    def settings(self) -> dict[str, Any]:
        """Constructor arguments beside robot and joints, in plain types."""
        return {}

    @classmethod
    def from_settings(cls, robot: RobotModel, joints: Sequence[str], settings: dict[str, Any]) -> Effect:
        """The effect that ``settings`` describe."""
        return cls(robot, joints, **settings)

    @abstractmethod
    def fill(self, sample: Sample, out: FloatArray) -> None:
        """Write the columns into ``out`` of shape (n, p); entries that are always zero may be left alone.

        :meth:`RobotModel.rnea` has run on this sample just before.
        """

    def columns(self, sample: Sample) -> FloatArray:
        """Y of this effect, shape (n, p) [N m per unit of the parameter]."""
        self.robot.rnea(sample.q, sample.v, sample.a)
        out = np.zeros((self.robot.n, self.p))
        self.fill(sample, out)
        return out

    def torque(self, sample: Sample, theta: FloatArray) -> FloatArray:
        """Joint torques of this effect, shape (n,) [N m]: what a simulation adds at each step."""
        return self.columns(sample) @ theta


class JointEffect(Effect):
    """An effect with one parameter a joint, whose column loads only that joint: ``tau_j = c(q_j, v_j, a_j) theta_j``."""

    symbol: ClassVar[str]
    unit: ClassVar[str]
    slide_unit: ClassVar[str]

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.parameter_names = tuple(f"{self.symbol}[{name}]" for name in self.joint_names)
        self.units = tuple(self.slide_unit if robot.is_prismatic[j] else self.unit for j in self.joints)
        self._columns = np.arange(len(self.joints))

    @abstractmethod
    def curve(self, sample: Sample) -> FloatArray:
        """c of every joint, shape (n,) [N m per unit of the parameter]."""

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[self.joints, self._columns] = self.curve(sample)[self.joints]

    def torque(self, sample: Sample, theta: FloatArray) -> FloatArray:
        curve = self.curve(sample)
        if len(self.joints) == self.robot.n:
            return curve * theta
        tau = np.zeros(self.robot.n)
        tau[self.joints] = curve[self.joints] * theta
        return tau
