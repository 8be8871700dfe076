"""A joint whose torque holds a part of its neighbour's, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import (
    Circumstances,
    HiddenCause,
    HiddenEffect,
    Signals,
    TrueRobot,
    register_hidden,
)
from sysid_ros.simulation.hidden_effects.hidden_effect import TrueParameter


@register_hidden
class JointCoupling(HiddenCause):
    """``tau_j - c tau_neighbour``: the effort of one motor also carries a part of its neighbour's."""

    id = "joint_coupling"
    in_messages = True
    local = True
    ordered = True
    leads = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        last = c.robot.n - 1
        j = c.one_joint(np.arange(last + 1) > 0)
        other = 1 if j == 0 else j - 1 if j == last or c.uniform(0.0, 1.0) < 0.5 else j + 1
        size = c.sign() * min(c.share(0.1, 0.4) * c.torque[j] / c.torque[other], 0.6)
        names = c.robot.joint_names
        return HiddenEffect(self.id, (names[j], names[other]), (TrueParameter("c", names[j], float(size), ""),))

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        joint, other = (robot.index(j) for j in effect.joints)
        tau = signals.tau.copy()
        tau[:, joint] -= effect.per_joint("c")[effect.joints[0]] * true.tau[:, other]
        return signals.with_tau(tau)

    def shows_on(self, effect: HiddenEffect) -> tuple[str, ...]:
        return effect.joints[:1]
