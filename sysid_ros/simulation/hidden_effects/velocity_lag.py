"""Velocities behind a low-pass, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.channels import Lagging
from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class VelocityLag(HiddenCause):
    """Velocities behind a low-pass in the drive."""

    id = "velocity_lag"
    in_torque = False
    changes_input = True
    whole_arm = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        return c.whole_arm(self.id, {"cutoff": (c.uniform(3.0, 12.0), "Hz")})

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.channels.append(Lagging(effect.number("cutoff")))
