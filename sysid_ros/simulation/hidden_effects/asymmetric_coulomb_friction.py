"""Coulomb friction with a level for each direction, hidden."""

from sysid_ros.simulation.hidden_effects.cause import Circumstances, register_hidden
from sysid_ros.simulation.hidden_effects.coulomb_friction import DryFriction


@register_hidden
class AsymmetricCoulombFriction(DryFriction):
    """``F_pos`` forward, ``F_neg`` backward."""

    id = "asymmetric_coulomb_friction"
    parameters = (("F_pos", "N m"), ("F_neg", "N m"))
    adds = (("coulomb_forward", "F_pos"), ("coulomb_backward", "F_neg"))
    # a level forward and another backward are a Coulomb friction and a constant: the constant may not be taken from it
    plain = ("constant",)
    equivalent = ("coulomb_friction", "torque_offset")

    def sizes(self, c: Circumstances, joints: list[int]) -> list[list[float]]:
        (one,) = super().sizes(c, joints)
        other = [level * c.uniform(0.35, 0.7) for level in one]
        return [one, other] if c.sign() > 0.0 else [other, one]
