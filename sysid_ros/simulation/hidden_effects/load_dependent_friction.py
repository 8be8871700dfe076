"""Friction that grows with the load, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, register_hidden
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

    def as_built(self, c: Circumstances) -> tuple[HiddenEffect, ...]:
        joints = np.flatnonzero(c.torque > 0.1 * c.effort).tolist()
        factors = np.exp(c.rng.uniform(np.log(0.02), np.log(0.1), len(joints))).tolist()
        return (self.on(c, joints, [[0.0] * len(joints), factors]),) if joints else ()
