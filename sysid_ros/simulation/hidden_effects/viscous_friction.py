"""Viscous friction, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, TorqueShare, register_hidden


@register_hidden
class ViscousFriction(TorqueShare):
    """``b v``."""

    id = "viscous_friction"
    parameters = (("b", "N m s/rad"),)
    adds = (("viscous", "b"),)
    family = "friction"
    everywhere = True
    plain = ("velocity",)
    share, usual_share = (0.05, 0.3), (0.05, 0.3)

    def usual(self, c: Circumstances, joint: int) -> float:
        return float(c.speed[joint])

    def usual_sizes(self, c: Circumstances) -> list[list[float]]:
        return [c.of_effort(0.01, 0.05)]  # at 1 rad/s
