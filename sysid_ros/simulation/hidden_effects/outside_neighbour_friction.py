"""Dry friction by the neighbour's position, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, register_hidden
from sysid_ros.simulation.hidden_effects.outside import ByNeighbour


@register_hidden
class OutsideNeighbourFriction(ByNeighbour):
    """Dry friction whose level follows the neighbour's position: ``F (1 + share sin(2 q_neighbour)) sign(v)``."""

    id = "outside_neighbour_friction"
    adds = (("coulomb_forward", "level"), ("coulomb_backward", "level"))
    puts = (("neighbour_friction", "share"),)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return self.beside(c, j, level=float(c.share(0.1, 0.4) * c.torque[j]), share=c.uniform(0.6, 1.0))
