"""Dry friction that grows with the load on the gear."""

import numpy as np

from sysid_ros.effects.coulomb_friction import DryFriction
from sysid_ros.effects.effect import Depends, JointCurves
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class LoadDependentFriction(DryFriction, JointCurves):
    """``tau_j = s (Fc + mu |tau_link|)``, s = tanh(v / width), Fc >= 0 [N m], mu >= 0 [1] (Hamon, Gautier, Garrec 2010, section
    III). The load is the model's torque on the link side: the measured one would bring its noise into the column.
    """

    id = "load_dependent_friction"
    label = "friction that grows with the load"
    words = "dry friction that grows with the load on {where} ({Fc} without load, {mu} N m for each N m of load)"
    depends_on = frozenset({Depends.LOAD})
    usual = 0.4
    nonnegative = True
    symbols = ("Fc", "mu")
    symbol_units = ("N m", "1")
    signature = "the level of friction follows the torque that the links need"
    look_alikes = ("torque_scale", "asymmetric_coulomb_friction", "coulomb_friction")
    separated_by = "the same loaded and unloaded postures passed in both directions"

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        s = self.sign(state)
        return np.stack([s, s * np.abs(load)])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.of_symbol("Fc", theta)

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return bool(theta[0] + 2.0 * std[0] > 0.0 and theta[1] > 0.0)
