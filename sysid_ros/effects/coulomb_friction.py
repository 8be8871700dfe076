"""Dry friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

from sysid_ros.effects.effect import JointEffect, Knob
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import TURNS, smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class CoulombFriction(JointEffect):
    """``tau_j = Fc_j tanh(v_j / width)``, Fc >= 0 [N m] (Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, section 2).

    Args:
        robot: the model.
        joints: joints that rub; empty for all.
        width: speed at which the sign function has turned, well above the noise of the velocity [rad/s].

    Raises:
        ModelFileError: the width is not a positive number.
    """

    id: ClassVar[str] = "coulomb_friction"
    label: ClassVar[str] = "Coulomb friction"
    family: ClassVar[str] = "dry friction"
    usual: ClassVar[float] = 0.9
    jumps: ClassVar[bool] = True
    in_urdf: ClassVar[bool] = True
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("width", 0.001, 0.1, "rad/s", reach=5.0, reported=False),)
    signature: ClassVar[str] = "two levels of equal size by direction of motion"
    look_alikes: ClassVar[tuple[str, ...]] = ("stribeck_friction", "presliding_hysteresis", "asymmetric_coulomb_friction")
    separated_by: ClassVar[str] = "several speeds in both directions, with reversals"
    nonnegative: ClassVar[bool] = True
    symbol: ClassVar[str] = "Fc"
    unit: ClassVar[str] = "N m"
    slide_unit: ClassVar[str] = "N"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), width: float = TURNS) -> None:
        super().__init__(robot, joints)
        if isinstance(width, bool) or not isinstance(width, int | float) or not 0.0 < width < math.inf:
            raise ModelFileError(f"effect '{self.id}' has width {width!r}; it must be a positive speed in rad/s.")
        self.width = float(width)

    @property
    def settings(self) -> dict[str, Any]:
        return {"width": self.width}

    def curve(self, sample: Sample | Motion) -> FloatArray:
        return smoothed_sign(sample.v, self.width)

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.per_joint(theta)

    def smoothed(self, width: float) -> CoulombFriction:
        return CoulombFriction(self.robot, self.joint_names, width=width)
