"""What every factor on the efforts has in common when it is hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.cause import HiddenCause, HiddenEffect, Signals, TrueRobot


class Gain(HiddenCause):
    """Effort times its first parameter: another constant, unit or sign."""

    in_messages = True

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        gain = robot.per_joint(effect.per_joint(self.parameters[0][0]), 1.0)
        return signals.with_tau(signals.tau * gain)
