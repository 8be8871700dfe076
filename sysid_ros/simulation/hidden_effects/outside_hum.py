"""A disturbance in time, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, register_hidden
from sysid_ros.simulation.hidden_effects.outside import Outside


@register_hidden
class OutsideHum(Outside):
    """A disturbance of fixed frequency in time."""

    id = "outside_hum"
    adds = (("hum", "amplitude"),)
    puts = (("hum_frequency", "frequency"),)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return self.hidden(c, j, amplitude=float(c.share(0.1, 0.4) * c.torque[j]), frequency=c.uniform(0.8, 4.0))
