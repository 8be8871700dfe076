"""Efforts in another unit, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Gained
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden

_UNITS = {"mN m": 1000.0, "N cm": 100.0, "lbf ft": 0.737562, "lbf in": 8.850746}


@register_hidden
class TorqueUnit(HiddenCause):
    """All efforts in another unit, or motor currents."""

    id = "torque_unit"
    changes_input = True
    whole_arm = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        n = c.robot.n
        if c.uniform(0.0, 1.0) < 0.5:
            kind = str(c.rng.choice(list(_UNITS)))
            factor = dict.fromkeys(range(n), _UNITS[kind])
        else:
            kind = "A"
            strong = c.torque / c.torque.max()
            factor = {j: 1.0 / (c.uniform(6.0, 14.0) if strong[j] > 0.2 else c.uniform(3.0, 11.0)) for j in range(n)}
        return c.effect(self.id, list(range(n)), {"factor": (factor, f"{kind} / (N m)")}, kind)

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Gained(true.per_joint(effect.per_joint("factor"), 1.0)))
