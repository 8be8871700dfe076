"""Friction in proportion to speed."""

from __future__ import annotations

from typing import ClassVar

from sysid_ros.effects.effect import JointEffect
from sysid_ros.sample import FloatArray, Sample


class ViscousFriction(JointEffect):
    """``tau_j = b_j v_j``, b >= 0 [N m s/rad] (Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, section 2)."""

    id: ClassVar[str] = "viscous_friction"
    label: ClassVar[str] = "viscous friction"
    nonnegative: ClassVar[bool] = True
    symbol: ClassVar[str] = "b"
    unit: ClassVar[str] = "N m s/rad"
    slide_unit: ClassVar[str] = "N s/m"

    def curve(self, sample: Sample) -> FloatArray:
        return sample.v
