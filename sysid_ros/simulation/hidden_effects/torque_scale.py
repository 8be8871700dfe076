"""A wrong torque constant, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Gained
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class TorqueScale(HiddenCause):
    """A wrong torque constant of one joint."""

    id = "torque_scale"
    local = True
    equivalent = ("torque_sign",)  # a gain of -1

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return c.effect(self.id, [j], {"gain": ({j: 1.0 + c.sign() * c.share(0.08, 0.3)}, "")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Gained(true.per_joint(effect.per_joint("gain"), 1.0)))
