"""Efforts that come late, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import ArmCause, Circumstances, HiddenEffect, Signals, TrueRobot, register_hidden


@register_hidden
class TimeDelay(ArmCause):
    """Efforts that come late."""

    id = "time_delay"
    in_messages = True
    parameters = (("delay", "s"),)
    leads = True

    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        return [max(c.share(0.006, 0.02), 0.004)]

    def as_built(self, c: Circumstances) -> tuple[HiddenEffect, ...]:
        return (self.of_arm(c, [c.uniform(0.001, 0.005)]),)

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        earlier = signals.t - effect.number("delay")
        late = np.column_stack([np.interp(earlier, signals.t, x) for x in true.tau.T])
        return signals.with_tau(signals.tau + late - true.tau)
