"""Friction that changes with time, as a gear that warms up, or with the temperature itself where that is measured."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.effects.coulomb_friction import DryFriction
from sysid_ros.effects.effect import Depends, JointCurves
from sysid_ros.effects.parameter import Parameter
from sysid_ros.effects.traits import Candidate
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import TURNS
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_OVER = ("time", "temperature")
_DRIFTS = 4.0
"""Standard deviations that a rate must be away from zero."""
_WARMS = 1.0
"""A joint must warm up or cool down by so much before its friction is asked to follow [K]."""
_TAIL = 0.02
"""Part of the readings at either end that does not count for that: a reading may jump."""


def usual_temperature(motions: Sequence[Motion], joint: int) -> float | None:
    """Mean temperature of a joint, None where it is not known or does not change [degrees Celsius]."""
    column = [m.temperature[:, joint] for m in motions if m.temperature is not None]
    if len(column) < len(motions):
        return None
    values = np.concatenate(column)
    if not np.isfinite(values).all() or np.ptp(np.quantile(values, [_TAIL, 1.0 - _TAIL])) < _WARMS:
        return None
    return round(float(values.mean()), 1)


class FrictionDrift(DryFriction, JointCurves):
    """``tau_j = s (Fc + rate_Fc x) + v (b + rate_b x)``, s = tanh(v / width) [N m]; x is the time from ``start`` [s], or how much
    warmer joint j is than ``reference`` [K] (Bittencourt, Axelsson 2014: friction of a gear against its temperature).

    A state without a temperature is taken as one at ``reference``: Fc and b are the friction there.

    Args:
        robot: the model. joints: joints that rub; empty for all. width: speed at which the sign function has turned [rad/s].
        start: time from which it drifts [s]. over: "time" or "temperature". reference: temperature of Fc and b [degrees Celsius].
    """

    id = "friction_drift"
    label = "friction that drifts"
    words = "friction that changes with {over} on {where} (dry {Fc}, changing by {rate_Fc}; viscous {b}, changing by {rate_b})"
    depends_on = frozenset({Depends.TEMPERATURE, Depends.TIME})
    usual = 0.2
    includes = ("coulomb_friction", "viscous_friction")
    times = ("start",)
    symbols = ("Fc", "rate_Fc", "b", "rate_b")
    symbol_units = ("N m", "N m/s", "N m s/rad", "N m/rad")
    signature = "the ribbon of the residual against the speed narrows or widens with time"
    look_alikes = ("coulomb_friction", "viscous_friction", "torque_offset_drift")
    separated_by = "the same motion early and late in a recording of minutes"

    def __init__(
        self,
        robot: RobotModel,
        joints: Sequence[str] = (),
        width: float = TURNS,
        start: float = 0.0,
        over: str = "time",
        reference: float = 25.0,
    ) -> None:
        super().__init__(robot, joints, width)
        if over not in _OVER:
            raise ModelFileError(f"effect '{self.id}' drifts over '{over}'; it must be one of {', '.join(_OVER)}.")
        self.start, self.over, self.reference = float(start), over, float(reference)
        if over == "temperature":
            self.name_joints(self.symbols, ("N m", "N m/K", "N m s/rad", "N m s/(rad K)"))

    @property
    def settings(self) -> dict[str, Any]:
        if self.over == "temperature":
            return {"width": self.width, "over": self.over, "reference": self.reference}
        return {"width": self.width, "start": self.start}

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        s = self.sign(state)
        if self.over == "time":
            x = (np.asarray(state.t) - self.start)[..., None]
        elif state.temperature is None:
            x = np.zeros(state.v.shape)
        else:
            x = np.nan_to_num(state.temperature - self.reference)
        return np.stack([s, s * x, state.v, state.v * x])

    def as_dry_friction(self, theta: FloatArray) -> FloatArray:
        return self.of_symbol("Fc", theta)

    def as_damping(self, theta: FloatArray) -> FloatArray:
        return self.of_symbol("b", theta)

    @property
    def form(self) -> str:
        return self.over if self.follows_temperature else ""

    @property
    def apart(self) -> str:
        return self.form

    @property
    def follows_temperature(self) -> bool:
        return self.over == "temperature"

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        usual = None if joint is None else usual_temperature(motions, joint)
        over_temperature = [] if usual is None else [Candidate({"over": "temperature", "reference": usual})]
        return [Candidate(), *over_temperature]

    @property
    def stated(self) -> FloatArray:
        (joint,) = self.joints
        return np.array([self.robot.friction[joint], 0.0, self.robot.damping[joint], 0.0])

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        high = theta + 2.0 * std
        drifts = np.abs(theta[[1, 3]]) > _DRIFTS * np.maximum(std[[1, 3]], 1e-12)
        return bool(high[0] > 0.0 and high[2] > 0.0 and np.any(drifts))

    def in_words(self, parameters: Sequence[Parameter], where: str) -> str:
        return super().in_words([*parameters, Parameter("over", None, self.over, "")], where)
