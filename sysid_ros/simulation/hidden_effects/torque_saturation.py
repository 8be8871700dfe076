"""A motor at its limit, or its sensor, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import (
    Circumstances,
    HiddenCause,
    HiddenEffect,
    Signals,
    TrueRobot,
    register_hidden,
)

_HOLDING = 1.1


@register_hidden
class TorqueSaturation(HiddenCause):
    """A motor, or the sensor of one, that can do no more; the published effort is what was asked for, or ends at the limit.

    A motor's limit holds the arm against gravity with some room: else the arm would fall, and not only lag behind.
    """

    id = "torque_saturation"
    in_messages = True
    parameters = (("limit", "N m"),)
    local = True
    leads = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        motor = c.uniform(0.0, 1.0) > 0.35
        low = np.abs(c.tau).max(axis=0) * (1.0 - c.uniform(0.15, 0.45) * c.scale)
        held = _HOLDING * np.abs(c.gravity).max(axis=0) < low
        j = c.one_joint(held if motor else None)
        if motor and held[j]:
            return self.on(c, [j], [[low[j]]], "motor")
        limit = np.quantile(np.abs(c.tau[:, j]), 1.0 - c.uniform(0.05, 0.15) * c.scale)
        return self.on(c, [j], [[float(limit)]], "sensor")

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        if effect.kind == "sensor":
            super().realise(effect, true)
        else:
            true.put("limit", effect.per_joint("limit"))

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        limit = robot.per_joint(effect.per_joint("limit"), np.inf)
        return signals.with_tau(np.clip(signals.tau, -limit, limit))
