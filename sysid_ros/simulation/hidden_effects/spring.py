"""A cable or a balancer, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class Spring(HiddenCause):
    """A cable ``k (q - q0)`` or a balancer ``k sin(q - q0)``."""

    id = "spring"
    parameters = (("k", "N m/rad"), ("q0", "rad"))
    local = True
    leads = True
    equivalent = ("link_inertia",)  # a link's weight about a horizontal axis is a balancer there

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint(np.ptp(c.q, axis=0) > 1.0)
        span, middle = 0.5 * np.ptp(c.q[:, j]), float(c.q[:, j].mean())
        kind = "balancer" if c.uniform(0.0, 1.0) < 0.35 else "cable"
        k = c.share(0.1, 0.5) * c.torque[j] / (1.0 if kind == "balancer" else span)
        units = ("N m" if kind == "balancer" else "N m/rad", "rad")
        return self.on(c, [j], [[k], [middle + c.uniform(-0.5, 0.5)]], kind, units)

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        array = "balancer" if effect.kind == "balancer" else "spring"
        true.add(array, effect.per_joint("k"))
        true.put(f"{array}_origin", effect.per_joint("q0"))
