"""Dry friction of a bristle, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.dry_friction import DryFriction
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class PreslidingHysteresis(DryFriction):
    """A bristle that bends by ``z_s`` before it slides."""

    id = "presliding_hysteresis"

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        level = self.levels(c, joints)
        return c.effect(self.id, joints, {"Fc": (level, "N m"), "z_s": ({j: c.uniform(0.02, 0.08) for j in joints}, "rad")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        super().realise(effect, true)
        true.put("presliding", effect.per_joint("z_s"))
