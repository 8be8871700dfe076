"""An encoder with its zero elsewhere, hidden."""

from dataclasses import replace

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, JointCause, Signals, TrueRobot, register_hidden


@register_hidden
class JointOffset(JointCause):
    """An encoder with its zero elsewhere: measured minus true."""

    id = "joint_offset"
    in_messages = True
    parameters = (("delta", "rad"),)
    single = True
    leads = True
    equivalent = ("backlash",)

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        return [[c.sign() * c.share(0.02, 0.12)]]

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        return replace(signals, q=signals.q + robot.per_joint(effect.per_joint("delta")))
