"""Friction in proportion to the square of the speed."""

import numpy as np

from sysid_ros.effects.effect import JointEffect
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class QuadraticFriction(JointEffect):
    """``tau_j = c_j v_j |v_j|``, c >= 0 [N m s^2/rad^2] (Swevers, Verdonck, De Schutter 2007, section on friction)."""

    id = "quadratic_friction"
    label = "friction with the square of the speed"
    words = "friction that grows with the square of the speed on {where} ({c})"
    nonnegative = True
    simpler = "viscous_friction"
    symbol = "c"
    unit = "N m s^2/rad^2"
    share = 0.1
    signature = "curved against the speed, odd"
    look_alikes = ("viscous_friction",)
    separated_by = "speeds from a fifth of the limit to nearly all of it"

    def curve(self, sample: Sample | Motion) -> FloatArray:
        curve: FloatArray = sample.v * np.abs(sample.v)
        return curve
