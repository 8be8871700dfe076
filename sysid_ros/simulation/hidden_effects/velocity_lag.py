"""Velocities behind a low-pass, hidden."""

from dataclasses import replace

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import ArmCause, Circumstances, HiddenEffect, Signals, TrueRobot, register_hidden


@register_hidden
class VelocityLag(ArmCause):
    """Velocities behind a first-order low-pass in the drive; straight lines between the messages, solved exactly."""

    id = "velocity_lag"
    in_messages = True
    parameters = (("cutoff", "Hz"),)
    in_torque = False
    changes_input = True

    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        return [c.uniform(3.0, 12.0)]

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        v, cutoff = signals.v.copy(), effect.number("cutoff")
        for k in range(1, len(v)):
            x = 2.0 * np.pi * cutoff * (signals.t[k] - signals.t[k - 1])
            decay = np.exp(-x)
            slope = (1.0 - decay) / x
            v[k] = decay * v[k - 1] + (1.0 - slope) * signals.v[k] + (slope - decay) * signals.v[k - 1]
        return replace(signals, v=v)
