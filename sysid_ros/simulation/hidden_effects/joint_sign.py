"""A joint counted the other way, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, HiddenEffect, JointCause, Signals, TrueRobot, register_hidden


@register_hidden
class JointSign(JointCause):
    """A joint counted the other way, in position, velocity and effort."""

    id = "joint_sign"
    in_messages = True
    parameters = (("sign", ""),)
    single = True
    changes_input = True
    sized = False

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        return [[-1.0]]

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        sign = robot.per_joint(effect.per_joint("sign"), 1.0)
        return Signals(signals.t, signals.q * sign, signals.v * sign, signals.tau * sign)
