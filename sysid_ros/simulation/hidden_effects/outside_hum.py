"""A disturbance in time, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.outside import Outside


@register_hidden
class OutsideHum(Outside):
    """A disturbance of fixed frequency in time."""

    id = "outside_hum"

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return self.hidden(c, j, amplitude=float(c.share(0.1, 0.4) * c.torque[j]), frequency=c.uniform(0.8, 4.0))

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.add("hum", {effect.joints[0]: effect.settings["amplitude"]})
        true.put("hum_frequency", {effect.joints[0]: effect.settings["frequency"]})
