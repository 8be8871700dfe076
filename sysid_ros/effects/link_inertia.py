"""The inertials of the arm's own links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from sysid_ros.effects.effect import Acts, Effect
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class LinkInertia(Effect):
    """Torque of the moving links, ``tau = Y(q, v, a) pi`` with ten standard parameters a link about its joint frame.

    Only the base parameters among them are determined by motion (Gautier, Khalil 1990).
    """

    id: ClassVar[str] = "link_inertia"
    label: ClassVar[str] = "link inertials"
    signature: ClassVar[str] = "gravity and inertial torque of one link, in all joints that carry it, changing with the posture"
    look_alikes: ClassVar[tuple[str, ...]] = ("payload", "spring", "torque_scale", "joint_offset")
    separated_by: ClassVar[str] = "60 degrees or more of at least two joints before the link, with accelerations"
    acts: ClassVar[Acts] = Acts.LINK
    usual: ClassVar[float] = 0.9
    replaces_links: ClassVar[bool] = True
    in_urdf: ClassVar[bool] = True

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        bodies = [robot.body_names[j] for j in self.joints]
        self.parameter_names = tuple(f"{name}[{body}]" for body in bodies for name in inertial_parameters.NAMES)
        self.units = inertial_parameters.UNITS * len(bodies)
        self._columns = [10 * int(j) + k for j in self.joints for k in range(10)]
        self._every_joint = len(self.joints) == robot.n

    @property
    def nominal(self) -> FloatArray:
        """The URDF's values of the parameters, shape (p,)."""
        return self.robot.pi[self._columns]

    def fill(self, sample: Sample, out: FloatArray) -> None:
        regressor = self.robot.regressor(sample.q, sample.v, sample.a)
        out[:] = regressor if self._every_joint else regressor[:, self._columns]

    def as_links(self, theta: FloatArray) -> FloatArray:
        out = np.zeros((self.robot.n, 10))
        out[self.joints] = (theta - self.nominal).reshape(-1, 10)
        return out

    def momentum_columns_along(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        pairs = [self.robot.momentum_regressors(q, v) for q, v in zip(motion.q, motion.v, strict=True)]
        momentum, rest = (np.stack(part)[:, :, self._columns] for part in zip(*pairs, strict=True))
        return momentum, rest

    def columns_along(self, motion: Motion) -> FloatArray:
        return np.asarray(motion.regressor[:, :, self._columns])
