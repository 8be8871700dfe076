"""Efforts that come late, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Delayed
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class TimeDelay(HiddenCause):
    """Efforts that come late."""

    id = "time_delay"
    whole_arm = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        return c.whole_arm(self.id, {"delay": (max(c.share(0.006, 0.02), 0.004), "s")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Delayed(effect.number("delay")))
