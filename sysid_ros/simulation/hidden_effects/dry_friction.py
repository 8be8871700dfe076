"""What every dry friction has in common when it is hidden."""

from __future__ import annotations

from sysid_ros.simulation.hidden_effects.hidden_cause import Circumstances, HiddenCause, HiddenEffect, TrueRobot


class DryFriction(HiddenCause):
    """Friction with a level ``Fc`` in both directions, and with what its own kind adds."""

    local = True
    family = "friction"
    dry = True

    def levels(self, c: Circumstances, joints: list[int]) -> dict[int, float]:
        """A usual level of each joint [N m]."""
        return {j: c.share(0.06, 0.35) * c.torque[j] for j in joints}

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.add("coulomb_forward", effect.per_joint("Fc"))
        true.add("coulomb_backward", effect.per_joint("Fc"))
