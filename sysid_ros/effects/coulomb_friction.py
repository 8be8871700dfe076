"""Dry friction."""

from __future__ import annotations

from sysid_ros.effects.dry_friction import DryFriction
from sysid_ros.effects.effect import JointEffect
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class CoulombFriction(DryFriction, JointEffect):
    """``tau_j = Fc_j tanh(v_j / width)``, Fc >= 0 [N m] (Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, section 2)."""

    id = "coulomb_friction"
    label = "Coulomb friction"
    usual = 0.9
    in_urdf = True
    signature = "two levels of equal size by direction of motion"
    look_alikes = ("stribeck_friction", "presliding_hysteresis", "asymmetric_coulomb_friction")
    separated_by = "several speeds in both directions, with reversals"
    nonnegative = True
    symbol = "Fc"
    unit = "N m"

    def curve(self, sample: Sample | Motion) -> FloatArray:
        return self.sign(sample)

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.per_joint(theta)

    def smoothed(self, width: float) -> CoulombFriction:
        return CoulombFriction(self.robot, self.joint_names, width=width)
