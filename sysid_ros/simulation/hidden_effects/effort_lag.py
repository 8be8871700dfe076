"""Efforts behind a low-pass, hidden."""

from sysid_ros.simulation.hidden_effects.cause import ArmCause, Circumstances, HiddenEffect, Signals, TrueRobot, register_hidden
from sysid_ros.simulation.hidden_effects.channels import low_passed


@register_hidden
class EffortLag(ArmCause):
    """Efforts behind a first-order low-pass in the driver."""

    id = "effort_lag"
    in_messages = True
    parameters = (("lag", "s"),)

    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        return [max(c.share(0.04, 0.08), 0.02)]

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        return signals.with_tau(signals.tau + low_passed(true.t, true.tau, effect.number("lag")) - true.tau)
