"""A wrong torque constant, hidden."""

from sysid_ros.simulation.hidden_effects.cause import (
    Circumstances,
    HiddenCause,
    HiddenEffect,
    JointCause,
    Signals,
    TrueRobot,
    register_hidden,
)


class Gain(HiddenCause):
    """Effort times its first parameter: another constant, unit or sign."""

    in_messages = True
    family = "gain"

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        gain = robot.per_joint(effect.per_joint(self.parameters[0][0]), 1.0)
        return signals.with_tau(signals.tau * gain)


@register_hidden
class TorqueScale(Gain, JointCause):
    """A wrong torque constant of one joint."""

    id = "torque_scale"
    parameters = (("gain", ""),)
    local = True
    single = True
    leads = True
    equivalent = ("torque_sign",)  # a gain of -1

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        return [[1.0 + c.sign() * c.share(0.08, 0.3)]]

    def usual_sizes(self, c: Circumstances) -> list[list[float]]:
        return [(1.0 + 0.02 * c.rng.standard_normal(c.robot.n)).tolist()]
