"""Friction in proportion to the square of the speed."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sysid_ros.effects.effect import JointEffect
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class QuadraticFriction(JointEffect):
    """``tau_j = c_j v_j |v_j|``, c >= 0 [N m s^2/rad^2] (Swevers, Verdonck, De Schutter 2007, section on friction)."""

    id: ClassVar[str] = "quadratic_friction"
    label: ClassVar[str] = "friction with the square of the speed"
    nonnegative: ClassVar[bool] = True
    simpler: ClassVar[str] = "viscous_friction"
    symbol: ClassVar[str] = "c"
    unit: ClassVar[str] = "N m s^2/rad^2"
    slide_unit: ClassVar[str] = "N s^2/m^2"
    signature: ClassVar[str] = "curved against the speed, odd"
    look_alikes: ClassVar[tuple[str, ...]] = ("viscous_friction",)
    separated_by: ClassVar[str] = "speeds from a fifth of the limit to nearly all of it"

    def curve(self, sample: Sample | Motion) -> FloatArray:
        curve: FloatArray = sample.v * np.abs(sample.v)
        return curve
