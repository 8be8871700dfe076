"""The inertia of a rotor, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class RotorInertia(HiddenCause):
    """``J a``."""

    id = "rotor_inertia"
    local = True
    equivalent = ("link_inertia",)  # about a vertical first axis only the sum of inertias shows

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        values = {j: c.share(0.05, 0.3) * c.torque[j] / c.acceleration[j] for j in joints}
        return c.effect(self.id, joints, {"J": (values, "kg m^2")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.add("rotor", effect.per_joint("J"))
