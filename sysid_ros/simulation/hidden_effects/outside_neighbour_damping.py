"""Viscous friction by the neighbour's position, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.outside import Outside


@register_hidden
class OutsideNeighbourDamping(Outside):
    """Viscous friction that follows the neighbour's position: ``d (1 + sin(q_neighbour)) v``."""

    id = "outside_neighbour_damping"

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        damping = c.share(0.1, 0.4) * c.torque[j] / c.speed[j]
        return self.hidden(c, j, neighbour=self.neighbour(c, j), damping=float(damping))

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        (joint,), settings = effect.joints, effect.settings
        true.put("neighbour", {joint: float(true.index(settings["neighbour"]))})
        true.put("neighbour_damping", {joint: settings["damping"]})
