"""A body that is picked up or put down during the recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, Knob
from sysid_ros.effects.payload import Payload
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class PayloadChange(Payload):
    """``tau = J_frame' Y_body theta`` from the time t0 on, ten parameters about the frame's origin.

    Args:
        robot: the model. joints: unused. frame: name of the frame; empty for the robot's default. t0: when it changes [s].
        recording: the one of several recordings in which it changes; empty where there is only one.
    """

    id: ClassVar[str] = "payload_change"
    label: ClassVar[str] = "change of the payload"
    acts: ClassVar[Acts] = Acts.LINK
    depends_on: ClassVar[frozenset[Depends]] = frozenset({Depends.TIME})
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("t0", 0.0, 1e9, "s", False),)
    signature: ClassVar[str] = "a step at one instant in all joints that carry the tool, then as a payload"
    look_alikes: ClassVar[tuple[str, ...]] = ("external_force", "torque_offset_drift", "payload")
    separated_by: ClassVar[str] = "the same motion before and after the change"

    def __init__(
        self, robot: RobotModel, joints: Sequence[str] = (), frame: str = "", t0: float = 0.0, recording: str = ""
    ) -> None:
        super().__init__(robot, joints, frame)
        self.t0 = float(t0)
        self.recording = recording

    @property
    def settings(self) -> dict[str, Any]:
        settings = {"frame": self.frame, "t0": self.t0}
        return {**settings, "recording": self.recording} if self.recording else settings

    def fill(self, sample: Sample, out: FloatArray) -> None:
        super().fill(sample, out)
        if sample.t < self.t0:
            out[:] = 0.0

    def as_links(self, theta: FloatArray) -> FloatArray:
        return np.zeros((self.robot.n, 10))

    def columns_along(self, motion: Motion) -> FloatArray:
        later = motion.t >= self.t0
        if self.recording and motion.recording != self.recording:
            later = np.zeros_like(later)
        columns: FloatArray = super().columns_along(motion) * later[:, None, None]
        return columns
