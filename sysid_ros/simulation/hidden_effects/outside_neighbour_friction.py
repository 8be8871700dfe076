"""Dry friction by the neighbour's position, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.outside import Outside


@register_hidden
class OutsideNeighbourFriction(Outside):
    """Dry friction whose level follows the neighbour's position: ``F (1 + share sin(2 q_neighbour)) sign(v)``."""

    id = "outside_neighbour_friction"

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        level = c.share(0.1, 0.4) * c.torque[j]
        return self.hidden(c, j, neighbour=self.neighbour(c, j), level=float(level), share=c.uniform(0.6, 1.0))

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        (joint,), settings = effect.joints, effect.settings
        true.put("neighbour", {joint: float(true.index(settings["neighbour"]))})
        true.add("coulomb_forward", {joint: settings["level"]})
        true.add("coulomb_backward", {joint: settings["level"]})
        true.put("neighbour_friction", {joint: settings["share"]})
