"""A ramp in the efforts, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import (
    Circumstances,
    HiddenEffect,
    Signals,
    TorqueShare,
    TrueRobot,
    register_hidden,
)


@register_hidden
class TorqueOffsetDrift(TorqueShare):
    """A ramp in time."""

    id = "torque_offset_drift"
    in_messages = True
    parameters = (("rate", "N m/s"),)
    family = "offset"
    share = (0.1, 0.5)
    signed = True

    def usual(self, c: Circumstances, joint: int) -> float:
        return c.motion.duration

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        ramp = np.multiply.outer(signals.t, robot.per_joint(effect.per_joint("rate")))
        return signals.with_tau(signals.tau + ramp)
