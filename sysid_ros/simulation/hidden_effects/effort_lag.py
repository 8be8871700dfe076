"""Efforts behind a low-pass, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import ArmCause, Circumstances, HiddenEffect, Signals, TrueRobot, register_hidden


@register_hidden
class EffortLag(ArmCause):
    """Efforts behind a first-order low-pass in the driver; straight lines between the messages, solved exactly."""

    id = "effort_lag"
    in_messages = True
    parameters = (("lag", "s"),)

    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        return [max(c.share(0.04, 0.08), 0.02)]

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        tau, lag = true.tau.copy(), effect.number("lag")
        for k in range(1, len(tau)):
            x = (signals.t[k] - signals.t[k - 1]) / lag
            decay = np.exp(-x)
            slope = (1.0 - decay) / x
            tau[k] = decay * tau[k - 1] + (1.0 - slope) * true.tau[k] + (slope - decay) * true.tau[k - 1]
        return signals.with_tau(signals.tau + tau - true.tau)
