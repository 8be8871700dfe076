"""A gear that yields under the torque it carries."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.compliance import deflection, torque_of
from sysid_ros.effects.effect import Depends, Effect, Knob, positive
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class JointElasticity(Effect):
    """``tau = ID(q - x, v - x', a - x'') - ID(q, v, a)``: the encoder stands on the motor's side and the link lags by the
    spring's deflection x, ``M x'' + d x' + k x = ID_j`` (Spong 1987). The linear parameter is the compliance 1 / k.

    One sample alone has the deflection under its load, without the derivatives; so have columns around a compliance of zero.

    Args:
        robot: the model. joints: joints that yield; empty for all.
        around: compliance at which the columns are those of the oscillating link, torque over compliance [rad/(N m)]; 0: of a
            link that follows its load at once.
        damping: of the spring over its critical value, with the link's mean inertia.
        exact: False for the links' torque to first order in x.
    """

    id: ClassVar[str] = "joint_elasticity"
    label: ClassVar[str] = "elastic joint"
    depends_on: ClassVar[frozenset[Depends]] = frozenset({Depends.LOAD})
    family: ClassVar[str] = "compliance"
    knobs: ClassVar[tuple[Knob, ...]] = (Knob("damping", 0.003, 1.0, "1"),)
    signature: ClassVar[str] = "a deflection in proportion to the load, in all joints around it; brings a rotor inertia with it"
    look_alikes: ClassVar[tuple[str, ...]] = ("joint_offset", "link_inertia", "torque_scale", "backlash")
    separated_by: ClassVar[str] = "heavy load in both directions, and fast parts near the resonance"

    def __init__(
        self,
        robot: RobotModel,
        joints: Sequence[str] = (),
        around: float = 0.0,
        damping: float = 0.05,
        exact: bool = True,
    ) -> None:
        super().__init__(robot, joints)
        self.around, self.damping, self.exact = float(around), positive(damping, "damping", self.id), bool(exact)
        self.parameter_names = tuple(f"compliance[{name}]" for name in self.joint_names)
        self.units = tuple("m/N" if robot.is_prismatic[j] else "rad/(N m)" for j in self.joints)

    @property
    def settings(self) -> dict[str, Any]:
        return {"around": self.around, "damping": self.damping, "exact": self.exact}

    def lag(self, motion: Motion, joint: int) -> FloatArray:
        """x of a joint with its two derivatives along a recording, shape (N, 3)."""
        return deflection(motion, joint, 1.0 / self.around, self.damping, exact=self.exact)

    def fill(self, sample: Sample, out: FloatArray) -> None:
        state = sample.q[None], sample.v[None], sample.a[None]
        by_q, _, _ = self.robot.rnea_derivatives_along(*state)
        out[:] = -(by_q[0] * self.robot.rnea_along(*state)[0])[:, self.joints]

    def columns_along(self, motion: Motion) -> FloatArray:
        out = []
        for j in self.joints:
            if self.around:
                out.append(torque_of(motion, int(j), self.lag(motion, int(j)), self.exact) / self.around)
            else:
                load = motion.link_torque[:, j]
                rate = motion.rate_of(load)
                out.append(torque_of(motion, int(j), np.stack([load, rate, motion.rate_of(rate)], axis=1), exact=False))
        return np.stack(out, axis=-1)
