"""A joint whose torque holds a part of its neighbour's, hidden."""

from __future__ import annotations

import numpy as np

from sysid_ros.simulation.hidden_effects.channels import Coupled
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.hidden_effect import TrueParameter


@register_hidden
class JointCoupling(HiddenCause):
    """``-c`` times a neighbour's torque."""

    id = "joint_coupling"
    local = True
    ordered = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        last = c.robot.n - 1
        j = c.one_joint(np.arange(last + 1) > 0)
        other = 1 if j == 0 else j - 1 if j == last or c.uniform(0.0, 1.0) < 0.5 else j + 1
        size = c.sign() * min(c.share(0.1, 0.4) * c.torque[j] / c.torque[other], 0.6)
        names = c.robot.joint_names
        return HiddenEffect(self.id, (names[j], names[other]), (TrueParameter("c", names[j], float(size), ""),))

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        joint, other = (true.index(j) for j in effect.joints)
        true.channels.append(Coupled(joint, other, effect.per_joint("c")[effect.joints[0]]))

    def shows_on(self, effect: HiddenEffect) -> tuple[str, ...]:
        return effect.joints[:1]
