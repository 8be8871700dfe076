"""A body on the tip link, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.bodies import TipBody
from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_cause import register_hidden
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect
from sysid_ros.simulation.hidden_effects.true_robot import TrueRobot


@register_hidden
class Payload(TipBody):
    """A box on the tip link."""

    id = "payload"
    equivalent = ("link_inertia",)  # a body on the last link is a part of the last link

    def draw(self, c: Circumstances) -> HiddenEffect:
        parameters, inertia = self.drawn_box(c)
        return c.whole_arm(self.id, parameters, inertia_com=inertia)

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.carry(self.body_of(effect))
