"""A torque constant that swings with time, hidden."""

from __future__ import annotations

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, Signals, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.outside import Outside


@register_hidden
class OutsideWobblingGain(Outside):
    """A torque constant that swings with time: ``1 + size sin(2 pi t / period)``."""

    id = "outside_wobbling_gain"
    in_messages = True

    def draw(self, c: Circumstances) -> HiddenEffect:
        j = c.one_joint(c.torque > 0.1 * c.torque.max())
        return self.hidden(c, j, size=c.share(0.15, 0.4), period=c.uniform(4.0, 9.0))

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        tau, joint = signals.tau.copy(), robot.index(effect.joints[0])
        tau[:, joint] *= 1.0 + effect.settings["size"] * np.sin(2.0 * np.pi * signals.t / effect.settings["period"])
        return signals.with_tau(tau)
