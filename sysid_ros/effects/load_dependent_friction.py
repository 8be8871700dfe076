"""Dry friction that grows with the load on the gear."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import Depends, JointCurves, Knob, positive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import TURNS, smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class LoadDependentFriction(JointCurves):
    """``tau_j = s (Fc + mu |tau_link|)``, s = tanh(v / width), Fc >= 0 [N m], mu >= 0 [1] (Hamon, Gautier, Garrec 2010, section
    III). The load is the model's torque on the link side: the measured one would bring its noise into the column.

    Args:
        robot: the model. joints: joints that rub; empty for all. width: speed at which the sign function has turned [rad/s].
    """

    id: ClassVar[str] = "load_dependent_friction"
    label: ClassVar[str] = "friction that grows with the load"
    depends_on: ClassVar[frozenset[Depends]] = frozenset({Depends.LOAD})
    family: ClassVar[str] = "dry friction"
    usual: ClassVar[float] = 0.4
    jumps: ClassVar[bool] = True
    nonnegative: ClassVar[bool] = True
    symbols: ClassVar[tuple[str, ...]] = ("Fc", "mu")
    symbol_units: ClassVar[tuple[str, ...]] = ("N m", "1")
    slide_units: ClassVar[tuple[str, ...]] = ("N", "1")
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("width", 0.001, 0.1, "rad/s", reach=5.0, reported=False),)
    signature: ClassVar[str] = "the level of friction follows the torque that the links need"
    look_alikes: ClassVar[tuple[str, ...]] = ("torque_scale", "asymmetric_coulomb_friction", "coulomb_friction")
    separated_by: ClassVar[str] = "the same loaded and unloaded postures passed in both directions"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), width: float = TURNS) -> None:
        super().__init__(robot, joints)
        self.width = positive(width, "width", self.id)

    @property
    def settings(self) -> dict[str, Any]:
        return {"width": self.width}

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        s = smoothed_sign(state.v, self.width)
        return np.stack([s, s * np.abs(load)])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.of_symbol("Fc", theta)

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return bool(theta[0] + 2.0 * std[0] > 0.0 and theta[1] > 0.0)
