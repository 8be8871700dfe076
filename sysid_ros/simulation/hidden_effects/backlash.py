"""Play in a joint, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, register_hidden
from sysid_ros.simulation.hidden_effects.joint_elasticity import Compliance

_FLANK_FREQUENCY = 300.0
_REVERSAL = 0.15


@register_hidden
class Backlash(Compliance):
    """A gap between the motor, whose position is measured, and a joint whose load changes its sign."""

    id = "backlash"
    parameters = (("gap", "rad"),)
    puts = (*Compliance.puts, ("gap", "gap"))
    damping_ratio = 0.3
    equivalent = ("joint_offset",)  # one flank bears all the time: half the gap is an offset
    rattles = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        forward = np.mean(c.tau > 0.0, axis=0)
        j = c.one_joint((forward > _REVERSAL) & (forward < 1.0 - _REVERSAL))
        motor = 0.2 * c.inertia[j]
        return self.on(c, [j], [[c.share(0.006, 0.03)]], motor_inertia=[motor], stiffness=[motor * _FLANK_FREQUENCY**2])
