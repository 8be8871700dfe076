"""Efforts without the torque of gravity, hidden."""

import numpy as np

from sysid_ros.simulation.hidden_effects.cause import ArmCause, Circumstances, HiddenEffect, Signals, TrueRobot, register_hidden


@register_hidden
class GravityCompensatedEffort(ArmCause):
    """Effort plus ``coef`` times the torque that the controller's model says gravity costs: without it, or with it twice."""

    id = "gravity_compensated_effort"
    in_messages = True
    parameters = (("coef", ""),)
    changes_input = True
    leads = True

    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        return [c.sign()]

    def publish(self, effect: HiddenEffect, robot: TrueRobot, signals: Signals, true: Signals) -> Signals:
        gravity = np.array([robot.robot.gravity_torque(q) for q in true.q])
        return signals.with_tau(signals.tau + effect.number("coef") * gravity)
