"""An elastic joint, hidden; and what a spring and a play between motor and link have in common."""

from typing import ClassVar

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenCause, HiddenEffect, Pairs, TrueRobot, register_hidden


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


@register_hidden
class JointElasticity(Compliance):
    """A spring between the motor, whose position is measured, and a joint that carries a load."""

    id = "joint_elasticity"
    parameters = (("stiffness", "N m/rad"),)
    leads = True
    damping_ratio = 0.03

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint(c.torque >= np.median(c.torque))
        return self.on(c, [j], [[c.torque[j] / c.share(0.006, 0.02)]], motor_inertia=[0.15 * c.inertia[j]])
