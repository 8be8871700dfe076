"""An encoder with its zero elsewhere, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Misaligned
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class JointOffset(HiddenCause):
    """An encoder with its zero elsewhere."""

    id = "joint_offset"
    equivalent = ("backlash",)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return c.effect(self.id, [j], {"delta": ({j: c.sign() * c.share(0.02, 0.12)}, "rad")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Misaligned(true.per_joint(effect.per_joint("delta"))))
