"""A gear that yields under the torque it carries."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import Effect
from sysid_ros.effects.motion import Motion
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample


class JointElasticity(Effect):
    """``tau = (ID(q - x, v - dx, a - ddx) - ID(q, v, a))``, x = tau_link,j / stiffness, to first order: the encoder stands on the
    motor's side and the link lags by the spring's deflection (Spong 1987). The linear parameter is the compliance 1 / stiffness.

    One sample alone has the deflection without its derivatives.

    Args:
        robot: the model. joints: joints that yield; empty for all.
        around: compliance at which the columns are exact [rad/(N m)].
    """

    id: ClassVar[str] = "joint_elasticity"
    label: ClassVar[str] = "elastic joint"
    signature: ClassVar[str] = "a deflection in proportion to the load, in all joints around it; brings a rotor inertia with it"
    look_alikes: ClassVar[tuple[str, ...]] = ("joint_offset", "link_inertia", "torque_scale", "backlash")
    separated_by: ClassVar[str] = "heavy load in both directions, and fast parts near the resonance"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), around: float = 0.0) -> None:
        super().__init__(robot, joints)
        self.around = float(around)
        self.parameter_names = tuple(f"compliance[{name}]" for name in self.joint_names)
        self.units = tuple("m/N" if robot.is_prismatic[j] else "rad/(N m)" for j in self.joints)

    @property
    def settings(self) -> dict[str, Any]:
        return {"around": self.around}

    def fill(self, sample: Sample, out: FloatArray) -> None:
        state = sample.q[None], sample.v[None], sample.a[None]
        by_q, _, _ = self.robot.rnea_derivatives_along(*state)
        out[:] = -(by_q[0] * self.robot.rnea_along(*state)[0])[:, self.joints]

    def columns_along(self, motion: Motion) -> FloatArray:
        by_q, by_v, by_a = motion.sensitivity
        load = motion.link_torque
        rate = motion.rate_of(load)
        if self.around:
            return self._secant(motion, load, rate, motion.rate_of(rate))
        columns = by_q * load[:, None] + by_v * rate[:, None] + by_a * motion.rate_of(rate)[:, None]
        return np.asarray(-columns[:, :, self.joints])

    def _secant(self, motion: Motion, load: FloatArray, rate: FloatArray, second: FloatArray) -> FloatArray:
        here = self.robot.rnea_along(motion.q, motion.v, motion.a)
        out = []
        for one in self.around * np.eye(self.robot.n)[self.joints]:
            state = motion.q - load * one, motion.v - rate * one, motion.a - second * one
            out.append((self.robot.rnea_along(*state) - here) / self.around)
        return np.stack(out, axis=-1)
