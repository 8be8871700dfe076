"""Coulomb friction with a level for each direction, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.dry_friction import DryFriction
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class AsymmetricCoulombFriction(DryFriction):
    """``F_pos`` forward, ``F_neg`` backward."""

    id = "asymmetric_coulomb_friction"
    # a level forward and another backward are a Coulomb friction and a constant: the constant may not be taken from it
    plain = ("constant",)
    equivalent = ("coulomb_friction", "torque_offset")

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        one = self.levels(c, joints)
        other = {j: one[j] * c.uniform(0.35, 0.7) for j in joints}
        forward, backward = (one, other) if c.sign() > 0.0 else (other, one)
        return c.effect(self.id, joints, {"F_pos": (forward, "N m"), "F_neg": (backward, "N m")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.add("coulomb_forward", effect.per_joint("F_pos"))
        true.add("coulomb_backward", effect.per_joint("F_neg"))
