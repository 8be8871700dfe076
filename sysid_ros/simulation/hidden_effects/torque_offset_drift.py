"""A ramp in the efforts, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Offset
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class TorqueOffsetDrift(HiddenCause):
    """A ramp in time."""

    id = "torque_offset_drift"
    local = True
    family = "offset"

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        values = {j: c.sign() * c.share(0.1, 0.5) * c.torque[j] / c.motion.duration for j in joints}
        return c.effect(self.id, joints, {"rate": (values, "N m/s")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Offset(true.per_joint({}), true.per_joint(effect.per_joint("rate"))))
