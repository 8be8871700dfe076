"""An effort from which the controller's own gravity torque was taken away, or to which it was added."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from sysid_ros.effects.effect import Acts, Effect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_COMPENSATED = 0.15
"""How far a coefficient may be from -1 or +1."""


class GravityCompensatedEffort(Effect):
    """``tau = coef g(q)``: -1 where gravity is missing from the effort, +1 where it stands in it twice [1].

    Args:
        robot: the model. joints: unused, the whole arm is concerned.
    """

    id: ClassVar[str] = "gravity_compensated_effort"
    label: ClassVar[str] = "effort with gravity already compensated"
    acts: ClassVar[Acts] = Acts.MEASUREMENT
    signature: ClassVar[str] = "the whole gravity torque, in all joints at once, with a factor of -1 or +1"
    look_alikes: ClassVar[tuple[str, ...]] = ("torque_scale", "link_inertia", "base_tilt")
    separated_by: ClassVar[str] = "fast motion in several postures: the inertial part of the torque is then right"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.parameter_names, self.units = ("coef",), ("1",)

    def fill(self, sample: Sample, out: FloatArray) -> None:
        still = sample.q[None] * 0.0
        out[:, 0] = self.robot.rnea_along(sample.q[None], still, still)[0]

    def columns_along(self, motion: Motion) -> FloatArray:
        return motion.gravity_torque[:, :, None]

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return abs(abs(float(theta[0])) - 1.0) < _COMPENSATED
