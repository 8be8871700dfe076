"""Velocities behind a low-pass, hidden."""

from dataclasses import replace

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import ArmCause, Circumstances, HiddenEffect, Signals, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.channels import low_passed


@register_hidden
class VelocityLag(ArmCause):
    """Velocities behind a first-order low-pass in the drive."""

    id = "velocity_lag"
    in_messages = True
    parameters = (("cutoff", "Hz"),)
    in_torque = False
    changes_input = True

    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        return [c.uniform(3.0, 12.0)]

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        return replace(signals, v=low_passed(signals.t, signals.v, 1.0 / (2.0 * np.pi * effect.number("cutoff"))))
