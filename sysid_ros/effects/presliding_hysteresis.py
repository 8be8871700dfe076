"""Dry friction that builds up over a small displacement after each reversal."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import JointCurves, Knob, positive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.bristle import bristle
from sysid_ros.signals.motion import Motion


class PreslidingHysteresis(JointCurves):
    """``tau_j = Fc z / z_s``, dz/dt = v - |v| z / z_s, Fc >= 0 [N m] (Dahl 1968; Canudas de Wit, Olsson, Åström, Lischinsky
    1995).

    The bristle's state z needs the recording from its start; one sample alone has the friction of steady sliding.

    Args:
        robot: the model. joints: joints that rub; empty for all. z_s: displacement over which friction builds up [rad].
    """

    id = "presliding_hysteresis"
    label = "presliding hysteresis"
    words = "dry friction that builds up only after each reversal on {where} ({Fc} after some {z_s})"
    setting_names = ("z_s",)
    family = "dry friction"
    usual = 0.3
    nonnegative = True
    jumps = True
    symbols = ("Fc",)
    symbol_units = ("N m",)
    knobs = (Knob("z_s", 2e-3, 0.2, "rad"),)
    signature = "after a reversal the residual follows the displacement: a loop against the position"
    look_alikes = ("coulomb_friction", "stribeck_friction", "joint_elasticity")
    separated_by = "slow reversals with strokes of a few hundredths of a radian"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), z_s: float = 0.01) -> None:
        super().__init__(robot, joints)
        self.z_s = positive(z_s, "z_s", self.id)

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        if isinstance(state, Motion):
            return bristle(state.q, self.z_s, state.period)[None]
        return smoothed_sign(state.v)[None]

    @property
    def stated(self) -> FloatArray:
        return np.full(self.p, self.robot.friction[self.joints[0]])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.of_symbol("Fc", theta)
