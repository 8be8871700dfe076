"""A body that is carried in one of several recordings, and not in the others."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sysid_ros.effects.effect import Depends
from sysid_ros.effects.parameter import Parameter
from sysid_ros.effects.payload import Payload
from sysid_ros.effects.searched import Searched
from sysid_ros.effects.traits import Candidate
from sysid_ros.effects.wording import one
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class OtherPayload(Payload):
    """``tau = J_frame' Y_body theta`` in one recording, ten parameters about the frame's origin [kg, kg m, kg m^2]: by how
    much what is carried there differs from what is carried in the other ones.

    Args:
        robot: the model. joints: unused. frame: name of the frame; empty for the robot's default.
        recording: the one of several recordings in which it is carried; empty for any.
    """

    id = "other_payload"
    label = "another payload in one recording"
    words = "in {recording} the robot carries {size} {more} than in the other recordings"
    depends_on = frozenset({Depends.TIME})
    setting_names = ("frame", "recording")
    of_recording = True
    on_legs = False
    signature = "all joints that carry the tool, from the first to the last moment of one recording, as a payload"
    look_alikes = ("payload", "torque_offset_drift", "link_inertia")
    separated_by = "the same motion with and without what is carried"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), frame: str = "", recording: str = "") -> None:
        super().__init__(robot, joints, frame)
        self.recording = recording

    @property
    def settings(self) -> dict[str, Any]:
        return {"frame": self.frame, **({"recording": self.recording} if self.recording else {})}

    def fill(self, sample: Sample, out: FloatArray) -> None:
        super().fill(sample, out)
        if self.recording:  # what is carried in a recording says nothing of a sample that is of none
            out[:] = 0.0

    def link_columns(self) -> None:
        return None

    def as_links(self, theta: FloatArray) -> FloatArray:
        return np.zeros((self.robot.n, 10))

    def columns_along(self, motion: Motion) -> FloatArray:
        columns = super().columns_along(motion)
        return np.zeros_like(columns) if self.recording and motion.recording != self.recording else columns

    @property
    def apart(self) -> str:
        return self.recording

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        """Every recording but the first of two: that the first of them carries less is that the other carries more."""
        names = list(dict.fromkeys(m.recording for m in motions))
        where, forms = names if len(names) > 2 else names[1:], super().candidates(motions, joint)
        return [Candidate({"recording": name}, c.basis, c.form) for name in where for c in forms]

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return True

    def excludes(self, other: Searched) -> bool:
        return isinstance(other, OtherPayload) and self.recording == other.recording

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        where = [Parameter("recording", None, self.recording, "")] if self.recording else []
        return [*super().as_parameters(values, covariance, basis), *where]

    def in_words(self, parameters: Sequence[Parameter], where: str) -> str:
        told, recording = {p.name: p for p in parameters}, self.recording or "one recording"
        if "mc" in told:
            return (
                f"in {recording} the robot carries something else than in the other recordings; the mass of the difference does "
                f"not show in this motion, its first moment about '{self.frame}' is {one(told['mc'])}"
            )
        size, more = replace(told["mass"], value=abs(told["mass"].value)), "more" if told["mass"].value > 0.0 else "less"
        own = {"size": one(size), "more": more, "recording": recording}
        others = [p for p in parameters if p.name != "recording"]
        return super().in_words([*others, *(Parameter(name, None, text, "") for name, text in own.items())], where)
