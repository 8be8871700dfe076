"""A constant in the efforts, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Offset
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class TorqueOffset(HiddenCause):
    """A constant."""

    id = "torque_offset"
    local = True
    family = "offset"
    plain = ("constant",)
    equivalent = ("asymmetric_coulomb_friction",)  # with a Coulomb friction, the same while the joint moves

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        return c.effect(self.id, joints, {"offset": ({j: c.sign() * c.share(0.04, 0.3) * c.torque[j] for j in joints}, "N m")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Offset(true.per_joint(effect.per_joint("offset")), true.per_joint({})))
