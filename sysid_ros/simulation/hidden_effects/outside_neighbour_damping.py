"""Viscous friction by the neighbour's position, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, register_hidden
from sysid_ros.simulation.hidden_effects.outside import ByNeighbour


@register_hidden
class OutsideNeighbourDamping(ByNeighbour):
    """Viscous friction that follows the neighbour's position: ``d (1 + sin(q_neighbour)) v``."""

    id = "outside_neighbour_damping"
    puts = (("neighbour_damping", "damping"),)

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint()
        return self.beside(c, j, damping=float(c.share(0.1, 0.4) * c.torque[j] / c.speed[j]))
