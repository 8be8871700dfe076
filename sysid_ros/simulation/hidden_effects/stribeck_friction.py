"""Stribeck friction, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.coulomb_friction import DryFriction


@register_hidden
class StribeckFriction(DryFriction):
    """``sign(v) (Fc + (Fs - Fc) exp(-(v / vs)^2))``."""

    id = "stribeck_friction"
    parameters = (("Fc", "N m"), ("Fs", "N m"), ("vs", "rad/s"))
    puts = (("stribeck_speed", "vs"),)
    either = "dry friction"

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        (level,) = super().sizes(c, joints)
        return [level, [fc * c.uniform(1.4, 2.2) for fc in level], [c.uniform(0.05, 0.15) for _ in joints]]

    def usual_sizes(self, c: Circumstances) -> list[list[float]]:
        level = c.of_effort(0.02, 0.1)
        return [level, [fc * c.uniform(1.1, 1.6) for fc in level], [c.uniform(0.03, 0.15) for _ in level]]

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        super().realise(effect, true)
        level = effect.per_joint("Fc")
        true.add("breakaway", {j: fs - level[j] for j, fs in effect.per_joint("Fs").items()})
