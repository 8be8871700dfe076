"""What every dry friction has in common when it is hidden."""

from typing import ClassVar

from sysid_ros.simulation.hidden_effects.cause import Pairs, TorqueShare


class DryFriction(TorqueShare):
    """Friction with a level ``Fc`` in both directions, and with what its own kind adds."""

    parameters: ClassVar[Pairs] = (("Fc", "N m"),)
    adds: ClassVar[Pairs] = (("coulomb_forward", "Fc"), ("coulomb_backward", "Fc"))
    family = "friction"
    dry = True
    share = (0.06, 0.35)
