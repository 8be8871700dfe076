"""A constant error of the torque measurement."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sysid_ros.effects.effect import Acts, JointEffect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class TorqueOffset(JointEffect):
    """``tau_j = offset_j`` [N m]."""

    id: ClassVar[str] = "torque_offset"
    label: ClassVar[str] = "torque offset"
    acts: ClassVar[Acts] = Acts.MEASUREMENT
    usual: ClassVar[float] = 0.5
    signature: ClassVar[str] = "a constant, at rest and in motion"
    look_alikes: ClassVar[tuple[str, ...]] = ("asymmetric_coulomb_friction", "spring", "joint_offset")
    separated_by: ClassVar[str] = "rests of a second in several postures"
    symbol: ClassVar[str] = "offset"
    unit: ClassVar[str] = "N m"
    slide_unit: ClassVar[str] = "N"

    def __init__(self, robot: RobotModel, joints: tuple[str, ...] = ()) -> None:
        super().__init__(robot, joints)
        self._ones = np.ones(robot.n)

    def curve(self, sample: Sample | Motion) -> FloatArray:
        return self._ones
