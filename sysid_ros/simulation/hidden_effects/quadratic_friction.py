"""Quadratic friction, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class QuadraticFriction(HiddenCause):
    """``c abs(v) v``."""

    id = "quadratic_friction"
    local = True
    family = "friction"

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        values = {j: c.share(0.06, 0.3) * c.torque[j] / c.speed[j] ** 2 for j in joints}
        return c.effect(self.id, joints, {"c": (values, "N m s^2/rad^2")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.add("quadratic", effect.per_joint("c"))
