"""A wrong torque constant, hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.cause import Circumstances, JointCause, register_hidden
from sysid_ros.simulation.hidden_effects.gain import Gain


@register_hidden
class TorqueScale(Gain, JointCause):
    """A wrong torque constant of one joint."""

    id = "torque_scale"
    parameters = (("gain", ""),)
    local = True
    single = True
    equivalent = ("torque_sign",)  # a gain of -1

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        return [[1.0 + c.sign() * c.share(0.08, 0.3)]]
