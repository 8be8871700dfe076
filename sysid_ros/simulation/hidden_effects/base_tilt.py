"""A base that does not stand upright, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class BaseTilt(HiddenCause):
    """A base that does not stand upright."""

    id = "base_tilt"
    whole_arm = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        roll, pitch = (c.sign() * c.share(0.025, 0.1) for _ in range(2))
        return c.whole_arm(self.id, {"roll": (roll, "rad"), "pitch": (pitch, "rad")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.tilt_base(effect.number("roll"), effect.number("pitch"))
