"""Inertia of the motors, seen through the gears."""

import numpy as np

from sysid_ros.effects.effect import JointEffect
from sysid_ros.effects.traits import Curve
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class RotorInertia(JointEffect):
    """``tau_j = J_j a_j``, J >= 0 [kg m^2] (Siciliano et al. 2009, section 7.2, without gyroscopic coupling)."""

    id = "rotor_inertia"
    label = "rotor inertia"
    words = "{unmodelled} rotor inertia on {where} ({J} at the joint)"
    signature = "in proportion to the joint's own acceleration, whatever the posture"
    look_alikes = ("link_inertia", "joint_elasticity")
    separated_by = "strong accelerations in several postures; on the first and the last joint a link's inertia is the same"
    nonnegative = True
    inertial = True
    usual = 0.9
    on_legs = True
    everywhere = True
    simple = Curve.ACCELERATION
    symbol = "J"
    unit = "kg m^2"

    def curve(self, sample: Sample | Motion) -> FloatArray:
        return sample.a

    @property
    def stated(self) -> FloatArray:
        return np.full(self.p, self.robot.model.armature[self.joints[0]])

    def as_armature(self, theta: FloatArray) -> FloatArray:
        return self.per_joint(theta)

    def momentum_columns_along(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        momentum = np.zeros((len(motion.t), self.robot.n, self.p))
        momentum[:, self.joints, self._columns] = motion.v[:, self.joints]
        return momentum, np.zeros_like(momentum)

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 3.4e-3 * torque, 8.5e-3 * torque
