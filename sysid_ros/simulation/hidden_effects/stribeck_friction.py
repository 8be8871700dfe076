"""Stribeck friction, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.dry_friction import DryFriction
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class StribeckFriction(DryFriction):
    """``sign(v) (Fc + (Fs - Fc) exp(-(v / vs)^2))``."""

    id = "stribeck_friction"

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        level = self.levels(c, joints)
        breakaway = {j: level[j] * c.uniform(1.4, 2.2) for j in joints}
        speed = {j: c.uniform(0.05, 0.15) for j in joints}
        return c.effect(self.id, joints, {"Fc": (level, "N m"), "Fs": (breakaway, "N m"), "vs": (speed, "rad/s")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        super().realise(effect, true)
        level = effect.per_joint("Fc")
        true.add("breakaway", {j: fs - level[j] for j, fs in effect.per_joint("Fs").items()})
        true.put("stribeck_speed", effect.per_joint("vs"))
