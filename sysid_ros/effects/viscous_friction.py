"""Friction in proportion to speed."""

import numpy as np

from sysid_ros.effects.effect import JointEffect
from sysid_ros.effects.traits import Curve
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class ViscousFriction(JointEffect):
    """``tau_j = b_j v_j``, b >= 0 [N m s/rad] (Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, section 2)."""

    id = "viscous_friction"
    label = "viscous friction"
    words = "{unmodelled} viscous friction on {where} ({b})"
    usual = 0.9
    on_legs = True
    everywhere = True
    in_urdf = True
    signature = "a straight line against the speed"
    look_alikes = ("time_delay", "quadratic_friction", "coulomb_friction")
    separated_by = "speeds from a tenth of the limit to nearly all of it"
    nonnegative = True
    simple = Curve.SPEED
    symbol = "b"
    unit = "N m s/rad"

    def curve(self, sample: Sample | Motion) -> FloatArray:
        return sample.v

    @property
    def stated(self) -> FloatArray:
        return np.full(self.p, self.robot.damping[self.joints[0]])

    def as_damping(self, theta: FloatArray) -> FloatArray:
        return self.per_joint(theta)

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.017 * torque, 0.07 * torque
