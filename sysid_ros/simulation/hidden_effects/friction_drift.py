"""Friction that fades as the joint warms up, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, register_hidden
from sysid_ros.simulation.hidden_effects.coulomb_friction import DryFriction


@register_hidden
class FrictionDrift(DryFriction):
    """Coulomb and viscous friction that fade as the joint warms up."""

    id = "friction_drift"
    parameters = (("Fc", "N m"), ("b", "N m s/rad"), ("rate_Fc", "N m/s"), ("rate_b", "N m/rad"))
    adds = (*DryFriction.adds, ("viscous", "b"), ("dry_rate", "rate_Fc"), ("viscous_rate", "rate_b"))
    companions = ("coulomb_friction", "viscous_friction")  # what drifts is these two

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        (level,) = super().sizes(c, joints)
        viscous = [c.uniform(0.2, 0.6) * fc / c.speed[j] for j, fc in zip(joints, level, strict=True)]
        rate = [-c.uniform(0.4, 0.8) / c.motion.duration for _ in joints]
        rates = ([r * x for r, x in zip(rate, values, strict=True)] for values in (level, viscous))
        return [level, viscous, *rates]
