"""A torque that does not go beyond a limit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, JointCurves, Knob, positive
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class TorqueSaturation(JointCurves):
    """``tau_j = -share max(|tau_link| - limit, 0) sign(tau_link)`` [N m]: the measured torque stays flat at the limit where share
    is 1.

    Or the motor itself can do no more, and the published effort is what was asked of it: ``tau_j = share max(|tau_measured| -
    limit, 0) sign(tau_measured)``.

    Args:
        robot: the model. joints: joints that saturate; empty for all. limit: largest torque [N m].
        kind: "sensor" or "motor": what it is the largest torque of.

    Raises:
        ModelFileError: there is no such kind, or the limit is not a positive number.
    """

    id: ClassVar[str] = "torque_saturation"
    label: ClassVar[str] = "saturation of the torque"
    acts: ClassVar[Acts] = Acts.MEASUREMENT
    depends_on: ClassVar[frozenset[Depends]] = frozenset({Depends.DRIVE})
    symbols: ClassVar[tuple[str, ...]] = ("share",)
    symbol_units: ClassVar[tuple[str, ...]] = ("1",)
    slide_units: ClassVar[tuple[str, ...]] = ("1",)
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("limit", 0.1, 1e4, "N m"),)
    signature: ClassVar[str] = "nothing below the limit, and beyond it all that exceeds it"
    look_alikes: ClassVar[tuple[str, ...]] = ("torque_scale",)
    separated_by: ClassVar[str] = "motion that reaches the limit from both sides, and some that stays well below it"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), limit: float = 10.0, kind: str = "sensor") -> None:
        super().__init__(robot, joints)
        self.limit = positive(limit, "limit", self.id)
        if kind not in ("sensor", "motor"):
            raise ModelFileError(f"effect '{self.id}' is of kind {kind!r}; it must be 'sensor' or 'motor'.")
        self.kind = kind

    @property
    def settings(self) -> dict[str, Any]:
        return {"limit": self.limit, "kind": self.kind}

    def curves_along(self, motion: Motion) -> FloatArray:
        return self.curves(motion, motion.drive_torque)

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        torque, sign = (load, -1.0) if self.kind == "sensor" else (state.tau, 1.0)
        return sign * (np.maximum(np.abs(torque) - self.limit, 0.0) * np.sign(torque))[None]
