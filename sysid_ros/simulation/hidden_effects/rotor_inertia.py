"""The inertia of a rotor, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, TorqueShare, register_hidden


@register_hidden
class RotorInertia(TorqueShare):
    """``J a``."""

    id = "rotor_inertia"
    parameters = (("J", "kg m^2"),)
    adds = (("rotor", "J"),)
    equivalent = ("link_inertia",)  # about a vertical first axis only the sum of inertias shows
    share = (0.05, 0.3)

    def usual(self, c: Circumstances, joint: int) -> float:
        return float(c.acceleration[joint])

    def usual_sizes(self, c: Circumstances) -> list[list[float]]:
        return [c.of_effort(0.003, 0.01)]  # at 1 rad/s^2
