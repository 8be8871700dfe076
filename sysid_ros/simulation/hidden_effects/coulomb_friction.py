"""Coulomb friction, hidden."""

from sysid_ros.simulation.hidden_effects.cause import register_hidden
from sysid_ros.simulation.hidden_effects.dry_friction import DryFriction


@register_hidden
class CoulombFriction(DryFriction):
    """``Fc sign(v)``."""

    id = "coulomb_friction"
    everywhere = True
    plain = ("sign",)
    equivalent = ("asymmetric_coulomb_friction",)  # with an offset, the same while the joint moves
    usual_share = (0.1, 0.4)
