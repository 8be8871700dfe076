"""Friction that grows with the load, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.dry_friction import DryFriction
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class LoadDependentFriction(DryFriction):
    """``sign(v) (Fc + mu abs(link torque))``, of joints whose load changes."""

    id = "load_dependent_friction"

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint(c.tau.std(axis=0) > 0.3 * c.torque)
        level, factor = c.share(0.03, 0.12) * c.torque[j], c.share(0.08, 0.3)
        return c.effect(self.id, [j], {"Fc": ({j: level}, "N m"), "mu": ({j: factor}, "")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        super().realise(effect, true)
        true.add("load_factor", effect.per_joint("mu"))
