"""Dry friction, and what every form of it has in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from sysid_ros.effects.effect import Effect, JointEffect, Knob, positive
from sysid_ros.effects.traits import Curve
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import TURNS, smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class DryFriction(Effect):
    """Friction in proportion to ``s = tanh(v / width)``, the sign of the velocity without its jump.

    Args:
        robot: the model. joints: joints that rub; empty for all.
        width: speed at which the sign function has turned, well above the noise of the velocity [rad/s].

    Raises:
        ModelFileError: the width is not a positive number.
    """

    family = "dry friction"
    jumps = True
    setting_names: ClassVar[tuple[str, ...]] = ("width",)
    knobs = (Knob("width", 0.001, 0.1, "rad/s", reach=5.0, reported=False),)

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), width: float = TURNS) -> None:
        super().__init__(robot, joints)
        self.width = positive(width, "width", self.id)

    @property
    def stated(self) -> FloatArray:
        return np.full(self.p, self.robot.friction[self.joints[0]])

    def sign(self, state: Sample | Motion) -> FloatArray:
        """s of every joint, as ``state.v``."""
        return smoothed_sign(state.v, self.width)


class CoulombFriction(DryFriction, JointEffect):
    """``tau_j = Fc_j tanh(v_j / width)``, Fc >= 0 [N m] (Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, section 2)."""

    id = "coulomb_friction"
    label = "Coulomb friction"
    words = "{unmodelled} dry friction (Coulomb) on {where} ({Fc})"
    usual = 0.9
    on_legs = True
    everywhere = True
    in_urdf = True
    signature = "two levels of equal size by direction of motion"
    look_alikes = ("stribeck_friction", "presliding_hysteresis", "asymmetric_coulomb_friction")
    separated_by = "several speeds in both directions, with reversals"
    nonnegative = True
    simple = Curve.SIGN
    symbol = "Fc"
    unit = "N m"

    def curve(self, sample: Sample | Motion) -> FloatArray:
        return self.sign(sample)

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.per_joint(theta)

    def smoothed(self, width: float) -> CoulombFriction:
        return CoulombFriction(self.robot, self.joint_names, width=width)

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.05 * torque, 0.14 * torque
