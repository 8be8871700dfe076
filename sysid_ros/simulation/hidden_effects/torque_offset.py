"""A constant in the efforts, hidden."""

from sysid_ros.simulation.hidden_effects.cause import (
    Circumstances,
    HiddenEffect,
    Signals,
    TorqueShare,
    TrueRobot,
    register_hidden,
)


@register_hidden
class TorqueOffset(TorqueShare):
    """A constant."""

    id = "torque_offset"
    in_messages = True
    parameters = (("offset", "N m"),)
    family = "offset"
    plain = ("constant",)
    equivalent = ("asymmetric_coulomb_friction",)  # with a Coulomb friction, the same while the joint moves
    share = (0.04, 0.3)
    signed = True
    leads = True

    def usual_sizes(self, c: Circumstances) -> list[list[float]]:
        return [(c.rng.uniform(-0.01, 0.01, c.robot.n) * c.effort).tolist()]

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        return signals.with_tau(signals.tau + robot.per_joint(effect.per_joint("offset")))
