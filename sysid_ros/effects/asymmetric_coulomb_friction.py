"""Dry friction that differs with the direction of motion."""

import numpy as np

from sysid_ros.effects.coulomb_friction import DryFriction
from sysid_ros.effects.effect import JointCurves
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class AsymmetricCoulombFriction(DryFriction, JointCurves):
    """``tau_j = F_pos max(s, 0) + F_neg min(s, 0)``, s = tanh(v / width), F_pos, F_neg >= 0 [N m] (Armstrong-Hélouvry, Dupont,
    Canudas de Wit 1994, section 2).
    """

    id = "asymmetric_coulomb_friction"
    label = "Coulomb friction that differs with the direction"
    words = "dry friction that differs with the direction on {where} ({F_pos} forward, {F_neg} backward)"
    usual = 0.2
    sum_of = ("coulomb_friction", "torque_offset")
    symbols = ("F_pos", "F_neg")
    symbol_units = ("N m", "N m")
    signature = "two levels of different size by direction"
    look_alikes = ("coulomb_friction", "torque_offset", "load_dependent_friction")
    separated_by = "reversals and rests of a second with the brakes open, where an offset stays and friction does not"

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        s = self.sign(state)
        return np.stack([np.maximum(s, 0.0), np.minimum(s, 0.0)])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return 0.5 * (self.of_symbol("F_pos", theta) + self.of_symbol("F_neg", theta))

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return bool(np.all(theta + 2.0 * std > 0.0)) and float(theta.sum()) > 0.0
