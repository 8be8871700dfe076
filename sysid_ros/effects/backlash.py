"""Play in a gear."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import Effect, positive
from sysid_ros.effects.motion import Motion
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample


class Backlash(Effect):
    """``tau = -d ID(q, v, a) / dq_j sign(tau_link,j) gap_j / 2`` [rad]: the link hangs on the side of the gap that its load
    pushes it to (Nordin, Gutman 2002).

    Args:
        robot: the model. joints: joints with play; empty for all. width: torque at which the side has changed [N m].
        around: gap at which the columns are exact [rad].
    """

    id: ClassVar[str] = "backlash"
    label: ClassVar[str] = "backlash"
    signature: ClassVar[str] = "a wrong zero that changes its sign with the load"
    look_alikes: ClassVar[tuple[str, ...]] = ("joint_offset", "joint_elasticity")
    separated_by: ClassVar[str] = "motion in which the load on the joint changes its sign"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), width: float = 0.2, around: float = 0.0) -> None:
        super().__init__(robot, joints)
        self.width, self.around = positive(width, "width", self.id), float(around)
        self.parameter_names = tuple(f"gap[{name}]" for name in self.joint_names)
        self.units = tuple("m" if robot.is_prismatic[j] else "rad" for j in self.joints)

    @property
    def settings(self) -> dict[str, Any]:
        return {"width": self.width, "around": self.around}

    def fill(self, sample: Sample, out: FloatArray) -> None:
        state = sample.q[None], sample.v[None], sample.a[None]
        by_q, _, _ = self.robot.rnea_derivatives_along(*state)
        side = np.tanh(self.robot.rnea_along(*state)[0] / self.width)
        out[:] = -0.5 * (by_q[0] * side)[:, self.joints]

    def columns_along(self, motion: Motion) -> FloatArray:
        side = np.tanh(motion.link_torque / self.width)
        if self.around:
            here = self.robot.rnea_along(motion.q, motion.v, motion.a)
            half = 0.5 * self.around * np.eye(self.robot.n)[self.joints]
            moved = [self.robot.rnea_along(motion.q - side * d, motion.v, motion.a) - here for d in half]
            return np.stack(moved, axis=-1) / self.around
        return np.asarray(-0.5 * (motion.sensitivity[0] * side[:, None])[:, :, self.joints])
