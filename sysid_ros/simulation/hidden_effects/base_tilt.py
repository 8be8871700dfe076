"""A base that does not stand upright, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_cause import HiddenCause, register_hidden
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect, TrueParameter
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot


@register_hidden
class BaseTilt(HiddenCause):
    """A base that does not stand upright."""

    id = "base_tilt"
    whole_arm = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        roll, pitch = (c.sign() * c.share(0.025, 0.1) for _ in range(2))
        return c.whole_arm(self.id, [TrueParameter("roll", None, roll, "rad"), TrueParameter("pitch", None, pitch, "rad")])

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.tilt_base(effect.number("roll"), effect.number("pitch"))
