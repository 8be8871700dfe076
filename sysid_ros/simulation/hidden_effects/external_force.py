"""A pull at the tip, hidden."""

import numpy as np

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.cause import ArmCause, Circumstances, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class ExternalForce(ArmCause):
    """A constant pull at the tip, mostly sideways: straight down it would weigh like a body."""

    id = "external_force"
    parameters = (("force", "N"),)
    leads = True

    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        direction = c.rng.normal(size=3) * np.array([1.0, 1.0, 0.5])
        force = direction / np.linalg.norm(direction) * c.share(0.3, 1.2) * c.mass
        return [tuple(force.tolist())]

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.force = true.force + effect.vector("force")

    def rivals(
        self, effect: HiddenEffect, true: TrueRobot, q: FloatArray, v: FloatArray, a: FloatArray
    ) -> tuple[FloatArray, list[FloatArray]]:
        return -true.tip_columns(q) @ true.force, [true.robot.regressor_along(q, v, a)[:, :, -10:]]
