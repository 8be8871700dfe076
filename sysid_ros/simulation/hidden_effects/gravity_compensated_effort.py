"""Efforts without the torque of gravity, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import WithGravity
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class GravityCompensatedEffort(HiddenCause):
    """Effort without the torque of gravity, or with it twice."""

    id = "gravity_compensated_effort"
    changes_input = True
    whole_arm = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        return c.whole_arm(self.id, {"coef": (c.sign(), "")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(WithGravity(true.robot, effect.number("coef")))
