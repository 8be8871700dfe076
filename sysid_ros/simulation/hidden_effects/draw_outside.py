"""Causes that no effect of the library describes, drawn: a diagnosis should say that something is left."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.circumstances import Circumstances
from sysid_ros.simulation.hidden_effects.hidden_effect import HiddenEffect


def _hidden(c: Circumstances, id_: str, joint: int, **settings: object) -> HiddenEffect:
    return HiddenEffect(id_, (c.robot.joint_names[joint],), (), "outside", settings)


def _neighbour(c: Circumstances, joint: int) -> str:
    return c.robot.joint_names[joint - 1 if joint > 0 else 1]


def outside_neighbour_friction(c: Circumstances) -> HiddenEffect:
    """Dry friction whose level follows the neighbour's position: ``F (1 + share sin(2 q_neighbour)) sign(v)``."""
    j = c.one_joint()
    level = c.share(0.1, 0.4) * c.torque[j]
    return _hidden(c, "outside_neighbour_friction", j, neighbour=_neighbour(c, j), level=float(level), share=c.uniform(0.6, 1.0))


def outside_neighbour_damping(c: Circumstances) -> HiddenEffect:
    """Viscous friction that follows the neighbour's position: ``d (1 + sin(q_neighbour)) v``."""
    j = c.one_joint()
    damping = c.share(0.1, 0.4) * c.torque[j] / c.speed[j]
    return _hidden(c, "outside_neighbour_damping", j, neighbour=_neighbour(c, j), damping=float(damping))


def outside_hum(c: Circumstances) -> HiddenEffect:
    """A disturbance of fixed frequency in time."""
    j = c.one_joint()
    return _hidden(c, "outside_hum", j, amplitude=float(c.share(0.1, 0.4) * c.torque[j]), frequency=c.uniform(0.8, 4.0))


def outside_wobbling_gain(c: Circumstances) -> HiddenEffect:
    """A torque constant that swings with time."""
    j = c.one_joint(c.torque > 0.1 * c.torque.max())
    return _hidden(c, "outside_wobbling_gain", j, size=c.share(0.15, 0.4), period=c.uniform(4.0, 9.0))
