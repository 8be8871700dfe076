"""A joint counted the other way, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Mirrored
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class JointSign(HiddenCause):
    """A joint counted the other way, in position, velocity and effort."""

    id = "joint_sign"
    changes_input = True
    sized = False

    def draw(self, c: Circumstances) -> HiddenEffect:
        return c.effect(self.id, [j := c.one_joint()], {"sign": ({j: -1.0}, "")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Mirrored(true.per_joint(effect.per_joint("sign"), 1.0)))
