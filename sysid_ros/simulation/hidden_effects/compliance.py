"""What a spring and a play between motor and link have in common when they are hidden."""

from typing import ClassVar

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import HiddenCause, HiddenEffect, Pairs, TrueRobot


class Compliance(HiddenCause):
    """A motor, whose position is measured, and a link that follows it through a spring.

    Attributes:
        damping_ratio: of motor and spring, over the critical one.
    """

    puts: ClassVar[Pairs] = (("stiffness", "stiffness"), ("motor_inertia", "motor_inertia"))
    family = "compliance"
    companions = ("rotor_inertia",)  # the motor behind the spring turns, and the URDF has no motors
    damping_ratio: ClassVar[float]

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        super().realise(effect, true)
        stiffness, motor = effect.per_joint("stiffness"), effect.per_joint("motor_inertia")
        true.put("compliance_damping", {j: 2.0 * self.damping_ratio * np.sqrt(k * motor[j]) for j, k in stiffness.items()})
