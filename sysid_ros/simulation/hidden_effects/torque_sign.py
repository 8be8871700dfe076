"""An effort counted the other way, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Gained
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class TorqueSign(HiddenCause):
    """Effort of one joint counted the other way."""

    id = "torque_sign"
    local = True
    changes_input = True
    sized = False
    equivalent = ("torque_scale",)

    def draw(self, c: Circumstances) -> HiddenEffect:
        return c.effect(self.id, [j := c.one_joint()], {"gain": ({j: -1.0}, "")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Gained(true.per_joint(effect.per_joint("gain"), 1.0)))
