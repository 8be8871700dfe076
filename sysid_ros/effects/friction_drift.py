"""Friction that changes with time, as a gear that warms up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import JointCurves, Knob, positive
from sysid_ros.effects.motion import Motion
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample


class FrictionDrift(JointCurves):
    """``tau_j = s (Fc + rate_Fc t) + v (b + rate_b t)``, s = tanh(v / width) [N m], t from the start of the recording
    (Bittencourt, Axelsson 2014: friction of a gear against its temperature).

    Args:
        robot: the model. joints: joints that rub; empty for all. width: speed at which the sign function has turned [rad/s].
        start: time from which it drifts [s].
    """

    id: ClassVar[str] = "friction_drift"
    label: ClassVar[str] = "friction that drifts"
    symbols: ClassVar[tuple[str, ...]] = ("Fc", "rate_Fc", "b", "rate_b")
    symbol_units: ClassVar[tuple[str, ...]] = ("N m", "N m/s", "N m s/rad", "N m/rad")
    slide_units: ClassVar[tuple[str, ...]] = ("N", "N/s", "N s/m", "N/m")
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("width", 0.001, 0.1, "rad/s"),)
    signature: ClassVar[str] = "the ribbon of the residual against the speed narrows or widens with time"
    look_alikes: ClassVar[tuple[str, ...]] = ("coulomb_friction", "viscous_friction", "torque_offset_drift")
    separated_by: ClassVar[str] = "the same motion early and late in a recording of minutes"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), width: float = 0.02, start: float = 0.0) -> None:
        super().__init__(robot, joints)
        self.width, self.start = positive(width, "width", self.id), float(start)

    @property
    def settings(self) -> dict[str, Any]:
        return {"width": self.width, "start": self.start}

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        s = np.tanh(state.v / self.width)
        since = (np.asarray(state.t) - self.start)[..., None]
        return np.stack([s, s * since, state.v, state.v * since])
