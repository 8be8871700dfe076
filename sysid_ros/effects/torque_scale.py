"""A wrong gain of the torque measurement, as from a wrong torque constant."""

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, JointCurves
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_USUAL_ERROR = 0.5
"""Usual size of a wrong gain: torque constants and currents' units are off by a part or by half, seldom by several times."""

_ON_LEGS = 0.02
"""What torque constants are off by from motor to motor."""


class TorqueScale(JointCurves):
    """``tau_j = (gain - 1) tau_link``, gain = measured / true; the parameter is gain - 1 [1]."""

    id = "torque_scale"
    label = "wrong gain of the torque"
    words = "efforts with a wrong gain on {where} (measured over true: {gain})"
    acts = Acts.MEASUREMENT
    on_legs = True
    signed_on_legs = True
    of_own_torque = True
    depends_on = frozenset({Depends.DRIVE})
    usual = 0.1
    between = (-0.98, np.inf)
    size = _USUAL_ERROR
    symbols = ("gain_error",)
    symbol_units = ("1",)
    signature = "in proportion to the joint's own torque, on that joint alone"
    look_alikes = ("link_inertia", "joint_elasticity", "load_dependent_friction")
    separated_by = "a joint that carries gravity, with the joints beyond it in several postures"

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        return np.array(load)[None]

    def usual_on_legs(self, torque: float) -> float:
        return _ON_LEGS

    def as_gain(self, theta: FloatArray) -> FloatArray:
        return 1.0 + self.of_symbol("gain_error", theta)

    def prior_std(self, form: str = "") -> FloatArray:
        return np.array([_USUAL_ERROR])

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        (joint,) = self.joint_names
        return [by_delta_method("gain", joint, "1", lambda x: 1.0 + float(x[0]), values, covariance)]

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.15, 0.3
