"""Dry friction of a bristle, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, register_hidden
from sysid_ros.simulation.hidden_effects.coulomb_friction import DryFriction


@register_hidden
class PreslidingHysteresis(DryFriction):
    """A bristle that bends by ``z_s`` before it slides."""

    id = "presliding_hysteresis"
    parameters = (("Fc", "N m"), ("z_s", "rad"))
    puts = (("presliding", "z_s"),)
    either = "dry friction"

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        return [*super().sizes(c, joints), [c.uniform(0.02, 0.08) for _ in joints]]

    def usual_sizes(self, c: Circumstances) -> list[list[float]]:
        return [c.of_effort(0.02, 0.1), np.exp(c.rng.uniform(np.log(0.005), np.log(0.04), c.robot.n)).tolist()]
