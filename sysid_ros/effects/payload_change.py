"""A body that is picked up or put down during the recording."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, Knob
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.effects.payload import Payload
from sysid_ros.effects.searched import Searched
from sysid_ros.effects.traits import Candidate
from sysid_ros.effects.wording import one
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_ONE_EVENT = 1.5
"""Changes of the payload nearer to one another are one [s]."""
_TIMES = 16
"""Times in a recording that are tried first, both its ends among them, which are no candidates."""


class PayloadChange(Payload):
    """``tau = J_frame' Y_body theta`` from the time t0 on, ten parameters about the frame's origin.

    Args:
        robot: the model. joints: unused. frame: name of the frame; empty for the robot's default. t0: when it changes [s].
        recording: the one of several recordings in which it changes; empty where there is only one.
    """

    id = "payload_change"
    label = "change of the payload"
    words = "a body of {size} {done} at {t0}{run}"
    acts = Acts.LINK
    depends_on = frozenset({Depends.TIME})
    knobs = (Knob("t0", 0.0, 1e9, "s", False, reach=2.0, bumpy=True, step=0.05),)
    instant = "t0"
    times = ("t0",)
    changes = Payload.id
    partial = True
    signature = "a step at one instant in all joints that carry the tool, then as a payload"
    look_alikes = ("external_force", "torque_offset_drift", "payload")
    separated_by = "the same motion before and after the change"

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

    def link_columns(self) -> None:
        return None

    def as_links(self, theta: FloatArray) -> FloatArray:
        return np.zeros((self.robot.n, 10))

    def columns_along(self, motion: Motion) -> FloatArray:
        later = motion.t >= self.t0
        if self.recording and motion.recording != self.recording:
            later = np.zeros_like(later)
        columns: FloatArray = super().columns_along(motion) * later[:, None, None]
        return columns

    @property
    def apart(self) -> str:
        return f"{self.recording} {self.t0:.3f}"

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        out, forms = [], super().candidates(motions, joint)
        names = tuple(dict.fromkeys(m.recording for m in motions))
        for name in names:
            own = [m for m in motions if m.recording == name]
            where: dict[str, Any] = {"recording": name} if len(names) > 1 else {}
            for t0 in np.linspace(min(m.t[0] for m in own), max(m.t[-1] for m in own), _TIMES)[1:-1]:
                out += [Candidate({"t0": float(t0), **where}, c.basis, c.form) for c in forms]
        return out

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return True

    def excludes(self, other: Searched) -> bool:
        if not isinstance(other, PayloadChange) or self.recording != other.recording:
            return False
        return abs(self.t0 - other.t0) < _ONE_EVENT

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        t0 = by_delta_method("t0", None, "s", lambda x: float(x[-1]), values, covariance)
        name = self.recording
        recording = [Parameter("recording", None, name, "")] if name else []
        return [*super().as_parameters(values, covariance, basis), t0, *recording]

    def in_words(self, parameters: Sequence[Parameter], where: str) -> str:
        mass = next(p for p in parameters if p.name == "mass")
        own = {
            "size": one(replace(mass, value=abs(mass.value))),
            "done": "picked up" if mass.value > 0.0 else "set down",
            "run": f" of {self.recording}" if self.recording else "",
        }
        return super().in_words([*parameters, *(Parameter(name, None, text, "") for name, text in own.items())], where)
