"""Friction that grows with the load, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, register_hidden
from sysid_ros.simulation.hidden_effects.coulomb_friction import DryFriction


@register_hidden
class LoadDependentFriction(DryFriction):
    """``sign(v) (Fc + mu abs(link torque))``, of joints whose load changes."""

    id = "load_dependent_friction"
    parameters = (("Fc", "N m"), ("mu", ""))
    adds = (*DryFriction.adds, ("load_factor", "mu"))
    share = (0.03, 0.12)

    def where(self, c: Circumstances) -> list[int]:
        return [c.one_joint(c.tau.std(axis=0) > 0.3 * c.torque)]

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        return [*super().sizes(c, joints), [c.share(0.08, 0.3)]]
