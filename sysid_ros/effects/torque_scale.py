"""A wrong gain of the torque measurement, as from a wrong torque constant."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, JointCurves
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class TorqueScale(JointCurves):
    """``tau_j = (gain - 1) tau_link``, gain = measured / true; the parameter is gain - 1 [1]."""

    id: ClassVar[str] = "torque_scale"
    label: ClassVar[str] = "wrong gain of the torque"
    acts: ClassVar[Acts] = Acts.MEASUREMENT
    depends_on: ClassVar[frozenset[Depends]] = frozenset({Depends.DRIVE})
    usual: ClassVar[float] = 0.1
    between: ClassVar[tuple[float, float]] = (-0.98, np.inf)
    symbols: ClassVar[tuple[str, ...]] = ("gain_error",)
    symbol_units: ClassVar[tuple[str, ...]] = ("1",)
    slide_units: ClassVar[tuple[str, ...]] = ("1",)
    signature: ClassVar[str] = "in proportion to the joint's own torque, on that joint alone"
    look_alikes: ClassVar[tuple[str, ...]] = ("link_inertia", "joint_elasticity", "load_dependent_friction")
    separated_by: ClassVar[str] = "a joint that carries gravity, with the joints beyond it in several postures"

    def curves_along(self, motion: Motion) -> FloatArray:
        return self.curves(motion, motion.drive_torque)

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        return np.array(load)[None]

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        (joint,) = self.joint_names
        return [by_delta_method("gain", joint, "1", lambda x: 1.0 + float(x[0]), values, covariance)]
