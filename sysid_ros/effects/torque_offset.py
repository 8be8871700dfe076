"""A constant error of the torque measurement."""

import numpy as np

from sysid_ros.effects.effect import Acts, JointEffect
from sysid_ros.effects.traits import Curve
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_ON_LEGS = 0.01
"""What a motor whose current is measured shows without a torque, over what a leg's joint holds while the robot stands; supposed,
not measured on robots."""
_OF_LIMIT = 0.1
"""Standard deviation of an offset before any data, over the joint's effort limit. It decides only where the motion does not: a
joint that hardly moves can't tell a large offset from a spring that undoes it."""


class TorqueOffset(JointEffect):
    """``tau_j = offset_j`` [N m]."""

    id = "torque_offset"
    label = "torque offset"
    words = "efforts with a constant offset on {where} ({offset})"
    acts = Acts.MEASUREMENT
    on_legs = True
    signed_on_legs = True
    usual = 0.5
    signature = "a constant, at rest and in motion"
    look_alikes = ("asymmetric_coulomb_friction", "spring", "joint_offset")
    separated_by = "rests of a second in several postures"
    simple = Curve.ONE
    symbol = "offset"
    unit = "N m"

    def usual_on_legs(self, torque: float) -> float:
        return _ON_LEGS * torque

    def prior_std(self, form: str = "") -> FloatArray:
        return _OF_LIMIT * self.robot.effort_limit[self.joints]

    def curve(self, sample: Sample | Motion) -> FloatArray:
        return np.ones(sample.q.shape)

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.07 * torque, 0.17 * torque
