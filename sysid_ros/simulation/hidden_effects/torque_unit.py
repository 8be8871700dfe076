"""Efforts in another unit, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, register_hidden
from sysid_ros.simulation.hidden_effects.torque_scale import Gain

_UNITS = {"mN m": 1000.0, "N cm": 100.0, "lbf ft": 0.737562, "lbf in": 8.850746}


@register_hidden
class TorqueUnit(Gain):
    """All efforts in another unit, or motor currents."""

    id = "torque_unit"
    parameters = (("factor", ""),)
    changes_input = True
    leads = True
    whole_arm = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        n = c.robot.n
        if c.uniform(0.0, 1.0) < 0.5:
            kind = str(c.rng.choice(list(_UNITS)))
            factors = [_UNITS[kind]] * n
        else:
            kind = "A"
            strong = c.torque / c.torque.max() > 0.2
            factors = [1.0 / (c.uniform(6.0, 14.0) if strong[j] else c.uniform(3.0, 11.0)) for j in range(n)]
        return self.on(c, list(range(n)), [factors], kind, [f"{kind} / (N m)"])
