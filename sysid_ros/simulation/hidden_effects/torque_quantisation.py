"""Efforts in steps, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import (
    Circumstances,
    HiddenCause,
    HiddenEffect,
    Signals,
    TrueRobot,
    register_hidden,
)

_LEAST_STEP, _LEVELS = 3.0, 6.0


@register_hidden
class TorqueQuantisation(HiddenCause):
    """Efforts in steps, of one joint or of all."""

    id = "torque_quantisation"
    in_messages = True
    parameters = (("step", "N m"),)
    in_torque = False
    changes_input = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        span = np.ptp(c.tau, axis=0)
        wide = span > _LEVELS * _LEAST_STEP * c.torque_noise
        all_of_them = c.only is None and c.uniform(0.0, 1.0) < 0.5 and np.any(wide)
        joints = np.flatnonzero(wide).tolist() if all_of_them else [c.one_joint(wide)]
        steps = [min(max(c.share(6.0, 20.0), _LEAST_STEP) * float(c.torque_noise[j]), span[j] / _LEVELS) for j in joints]
        return self.on(c, joints, [steps])

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        steps = robot.per_joint(effect.per_joint("step"))
        divisor = np.where(steps > 0.0, steps, 1.0)
        return signals.with_tau(np.where(steps > 0.0, np.round(signals.tau / divisor) * divisor, signals.tau))
