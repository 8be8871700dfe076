"""Joints under each other's names, hidden."""

from sysid_ros.simulation.hidden_effects.cause import (
    Circumstances,
    HiddenCause,
    HiddenEffect,
    Signals,
    TrueRobot,
    register_hidden,
)
from sysid_ros.simulation.hidden_effects.hidden_effect import TrueParameter


@register_hidden
class JointOrder(HiddenCause):
    """Two joints under each other's names, in the efforts alone or in all channels."""

    id = "joint_order"
    in_messages = True
    changes_input = True
    sized = False

    def draw(self, c: Circumstances) -> HiddenEffect:
        one = c.one_joint()
        other = int(c.rng.choice([j for j in range(c.robot.n) if j != one]))
        first, second = (c.robot.joint_names[j] for j in sorted((one, other)))
        parameters = (TrueParameter("takes_from", first, second, ""), TrueParameter("takes_from", second, first, ""))
        kind = "effort" if c.uniform(0.0, 1.0) < 0.5 else "all"
        return HiddenEffect(self.id, (first, second), parameters, kind)

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        source = {p.joint: str(p.value) for p in effect.parameters}
        order = [robot.index(source.get(joint, joint)) for joint in robot.robot.joint_names]
        if effect.kind == "effort":
            return signals.with_tau(signals.tau[:, order])
        return Signals(signals.t, signals.q[:, order], signals.v[:, order], signals.tau[:, order])
