"""An effort counted the other way, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, JointCause, register_hidden
from sysid_ros.simulation.hidden_effects.torque_scale import Gain


@register_hidden
class TorqueSign(Gain, JointCause):
    """Effort of one joint counted the other way."""

    id = "torque_sign"
    parameters = (("gain", ""),)
    local = True
    single = True
    changes_input = True
    sized = False
    equivalent = ("torque_scale",)

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        return [[-1.0]]
