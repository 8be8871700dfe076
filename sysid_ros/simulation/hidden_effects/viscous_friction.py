"""Viscous friction, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class ViscousFriction(HiddenCause):
    """``b v``."""

    id = "viscous_friction"
    local = True
    family = "friction"
    everywhere = True
    plain = ("velocity",)

    def draw(self, c: Circumstances) -> HiddenEffect:
        joints = c.some_joints()
        return self._effect(c, {j: c.share(0.05, 0.3) * c.torque[j] / c.speed[j] for j in joints})

    def draw_everywhere(self, c: Circumstances) -> HiddenEffect:
        return self._effect(c, {j: c.uniform(0.05, 0.3) * c.torque[j] / c.speed[j] for j in range(c.robot.n)})

    def _effect(self, c: Circumstances, values: dict[int, float]) -> HiddenEffect:
        return c.effect(self.id, list(values), {"b": (values, "N m s/rad")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.add("viscous", effect.per_joint("b"))
