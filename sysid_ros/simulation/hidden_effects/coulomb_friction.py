"""Coulomb friction, hidden; and what every dry friction has in common."""

from typing import ClassVar

from sysid_ros.simulation.hidden_effects.cause import Pairs, TorqueShare, register_hidden


class DryFriction(TorqueShare):
    """Friction with a level ``Fc`` in both directions, and with what its own kind adds."""

    parameters: ClassVar[Pairs] = (("Fc", "N m"),)
    adds: ClassVar[Pairs] = (("coulomb_forward", "Fc"), ("coulomb_backward", "Fc"))
    family = "friction"
    dry = True
    within: ClassVar[tuple[str, ...]] = ("coulomb_friction",)
    share = (0.06, 0.35)


@register_hidden
class CoulombFriction(DryFriction):
    """``Fc sign(v)``."""

    id = "coulomb_friction"
    everywhere = True
    leads = True
    within = ()
    plain = ("sign",)
    equivalent = ("asymmetric_coulomb_friction",)  # with an offset, the same while the joint moves
    usual_share = (0.1, 0.4)
