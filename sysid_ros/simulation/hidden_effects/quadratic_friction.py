"""Quadratic friction, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, TorqueShare, register_hidden


@register_hidden
class QuadraticFriction(TorqueShare):
    """``c abs(v) v``."""

    id = "quadratic_friction"
    parameters = (("c", "N m s^2/rad^2"),)
    adds = (("quadratic", "c"),)
    family = "friction"
    share = (0.06, 0.3)

    def usual(self, c: Circumstances, joint: int) -> float:
        return float(c.speed[joint] ** 2)
