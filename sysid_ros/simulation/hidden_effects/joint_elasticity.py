"""An elastic joint, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, register_hidden
from sysid_ros.simulation.hidden_effects.compliance import Compliance


@register_hidden
class JointElasticity(Compliance):
    """A spring between the motor, whose position is measured, and a joint that carries a load."""

    id = "joint_elasticity"
    parameters = (("stiffness", "N m/rad"),)
    damping_ratio = 0.03

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint(c.torque >= np.median(c.torque))
        return self.on(c, [j], [[c.torque[j] / c.share(0.006, 0.02)]], motor_inertia=[0.15 * c.inertia[j]])
