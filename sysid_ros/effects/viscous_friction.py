"""Friction in proportion to speed."""

from __future__ import annotations

from typing import ClassVar

from sysid_ros.effects.effect import JointEffect
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class ViscousFriction(JointEffect):
    """``tau_j = b_j v_j``, b >= 0 [N m s/rad] (Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, section 2)."""

    id: ClassVar[str] = "viscous_friction"
    label: ClassVar[str] = "viscous friction"
    usual: ClassVar[float] = 0.9
    in_urdf: ClassVar[bool] = True
    signature: ClassVar[str] = "a straight line against the speed"
    look_alikes: ClassVar[tuple[str, ...]] = ("time_delay", "quadratic_friction", "coulomb_friction")
    separated_by: ClassVar[str] = "speeds from a tenth of the limit to nearly all of it"
    nonnegative: ClassVar[bool] = True
    symbol: ClassVar[str] = "b"
    unit: ClassVar[str] = "N m s/rad"
    slide_unit: ClassVar[str] = "N s/m"

    def curve(self, sample: Sample | Motion) -> FloatArray:
        return sample.v

    def as_damping(self, theta: FloatArray) -> FloatArray:
        return self.per_joint(theta)
