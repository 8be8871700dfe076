"""A torque constant that swings with time, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Wobbling
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.outside import Outside


@register_hidden
class OutsideWobblingGain(Outside):
    """A torque constant that swings with time."""

    id = "outside_wobbling_gain"

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint(c.torque > 0.1 * c.torque.max())
        return self.hidden(c, j, size=c.share(0.15, 0.4), period=c.uniform(4.0, 9.0))

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Wobbling(true.index(effect.joints[0]), effect.settings["size"], effect.settings["period"]))
