"""A body on the tip link, hidden."""

from sysid_ros.simulation.hidden_effects.bodies import TipBody
from sysid_ros.simulation.hidden_effects.cause import HiddenEffect, TrueRobot, register_hidden


@register_hidden
class Payload(TipBody):
    """A box on the tip link."""

    id = "payload"
    equivalent = ("link_inertia",)  # a body on the last link is a part of the last link

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.carry(self.body_of(effect))
