"""Dry friction that differs with the direction of motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import JointCurves, Knob, positive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import TURNS, smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class AsymmetricCoulombFriction(JointCurves):
    """``tau_j = F_pos max(s, 0) + F_neg min(s, 0)``, s = tanh(v / width), F_pos, F_neg >= 0 [N m] (Armstrong-Hélouvry, Dupont,
    Canudas de Wit 1994, section 2).

    Args:
        robot: the model. joints: joints that rub; empty for all. width: speed at which the sign function has turned [rad/s].
    """

    id: ClassVar[str] = "asymmetric_coulomb_friction"
    label: ClassVar[str] = "Coulomb friction that differs with the direction"
    family: ClassVar[str] = "dry friction"
    usual: ClassVar[float] = 0.2
    sum_of: ClassVar[tuple[str, ...]] = ("coulomb_friction", "torque_offset")
    jumps: ClassVar[bool] = True
    symbols: ClassVar[tuple[str, ...]] = ("F_pos", "F_neg")
    symbol_units: ClassVar[tuple[str, ...]] = ("N m", "N m")
    slide_units: ClassVar[tuple[str, ...]] = ("N", "N")
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("width", 0.001, 0.1, "rad/s", reach=5.0, reported=False),)
    signature: ClassVar[str] = "two levels of different size by direction"
    look_alikes: ClassVar[tuple[str, ...]] = ("coulomb_friction", "torque_offset", "load_dependent_friction")
    separated_by: ClassVar[str] = (
        "reversals and rests of a second with the brakes open, where an offset stays and friction does not"
    )

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), width: float = TURNS) -> None:
        super().__init__(robot, joints)
        self.width = positive(width, "width", self.id)

    @property
    def settings(self) -> dict[str, Any]:
        return {"width": self.width}

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        s = smoothed_sign(state.v, self.width)
        return np.stack([np.maximum(s, 0.0), np.minimum(s, 0.0)])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return 0.5 * (self.of_symbol("F_pos", theta) + self.of_symbol("F_neg", theta))

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return bool(np.all(theta + 2.0 * std > 0.0)) and float(theta.sum()) > 0.0
