"""A torque that does not go beyond a limit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import JointCurves, Knob, positive
from sysid_ros.effects.motion import Motion
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample


class TorqueSaturation(JointCurves):
    """``tau_j = -share max(|tau_link| - limit, 0) sign(tau_link)`` [N m]: the measured torque stays flat at the limit where share
    is 1.

    Args:
        robot: the model. joints: joints that saturate; empty for all. limit: largest torque that is measured [N m].
    """

    id: ClassVar[str] = "torque_saturation"
    label: ClassVar[str] = "saturation of the torque"
    symbols: ClassVar[tuple[str, ...]] = ("share",)
    symbol_units: ClassVar[tuple[str, ...]] = ("1",)
    slide_units: ClassVar[tuple[str, ...]] = ("1",)
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("limit", 0.1, 1e4, "N m"),)
    signature: ClassVar[str] = "nothing below the limit, and beyond it all that exceeds it"
    look_alikes: ClassVar[tuple[str, ...]] = ("torque_scale",)
    separated_by: ClassVar[str] = "motion that reaches the limit from both sides, and some that stays well below it"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), limit: float = 10.0) -> None:
        super().__init__(robot, joints)
        self.limit = positive(limit, "limit", self.id)

    @property
    def settings(self) -> dict[str, Any]:
        return {"limit": self.limit}

    def curves_along(self, motion: Motion) -> FloatArray:
        return self.curves(motion, motion.drive_torque)

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        return -(np.maximum(np.abs(load) - self.limit, 0.0) * np.sign(load))[None]
