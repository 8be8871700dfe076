"""Friction that fades as the joint warms up, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.dry_friction import DryFriction
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class FrictionDrift(DryFriction):
    """Coulomb and viscous friction that fade as the joint warms up."""

    id = "friction_drift"
    companions = ("coulomb_friction", "viscous_friction")  # what drifts is these two

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        level = self.levels(c, joints)
        viscous = {j: c.uniform(0.2, 0.6) * level[j] / c.speed[j] for j in joints}
        rate = {j: -c.uniform(0.4, 0.8) / c.motion.duration for j in joints}
        values = {
            "Fc": (level, "N m"),
            "b": (viscous, "N m s/rad"),
            "rate_Fc": ({j: rate[j] * level[j] for j in joints}, "N m/s"),
            "rate_b": ({j: rate[j] * viscous[j] for j in joints}, "N m/rad"),
        }
        return c.effect(self.id, joints, values)

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        super().realise(effect, true)
        true.add("viscous", effect.per_joint("b"))
        true.add("dry_rate", effect.per_joint("rate_Fc"))
        true.add("viscous_rate", effect.per_joint("rate_b"))
