"""A body that is picked up during the motion, hidden."""

from dataclasses import replace

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.payload import TipBody

_WHEN = (0.3, 0.7)


@register_hidden
class PayloadChange(TipBody):
    """A box that is picked up during the motion."""

    id = "payload_change"
    parameters = (*TipBody.parameters, ("t0", "s"))

    def more(self, c: Circumstances) -> list[float]:
        return [c.uniform(*_WHEN) * c.motion.duration]

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.picked_up, true.change_time = self.body_of(effect), effect.number("t0")

    def at_another_time(self, effect: HiddenEffect, duration: float, rng: np.random.Generator) -> HiddenEffect:
        t0 = float(rng.uniform(*_WHEN) * duration)
        return replace(effect, parameters=tuple(replace(p, value=t0) if p.name == "t0" else p for p in effect.parameters))
