"""Coulomb friction, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.dry_friction import DryFriction
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, register_hidden


@register_hidden
class CoulombFriction(DryFriction):
    """``Fc sign(v)``."""

    id = "coulomb_friction"
    everywhere = True
    plain = ("sign",)
    equivalent = ("asymmetric_coulomb_friction",)  # with an offset, the same while the joint moves

    def draw(self, c: Circumstances) -> HiddenEffect:
        return self._effect(c, self.levels(c, c.some_joints()))

    def draw_everywhere(self, c: Circumstances) -> HiddenEffect:
        return self._effect(c, {j: c.uniform(0.1, 0.4) * c.torque[j] for j in range(c.robot.n)})

    def _effect(self, c: Circumstances, values: dict[int, float]) -> HiddenEffect:
        return c.effect(self.id, list(values), {"Fc": (values, "N m")})
