"""A gear that yields under the torque it carries."""

from collections.abc import Sequence
from typing import Self

import numpy as np

from sysid_ros.effects.compliance import Compliance, deflection, own_torques, torque_of
from sysid_ros.effects.effect import Knob, positive
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.effects.traits import Candidate, DeflectionSearch
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_RESONANCES = np.geomspace(0.8, 25.0, 80)
"""Of elastic joints [Hz]: 4 % apart, as a spring that is hardly damped shows in a narrow line."""
_DAMPING = 0.05
_YIELDS = 0.2
"""No gear yields by more under the loads of a recording [rad]."""


class JointElasticity(Compliance):
    """``tau = ID(q - x, v - x', a - x'') - ID(q, v, a)``: the link lags by the spring's deflection x, ``M x'' + d x' + k x =
    ID_j`` (Spong 1987). The linear parameter is the compliance 1 / k.

    One sample alone has the deflection under its load, without the derivatives; so have columns around a compliance of zero.

    Args:
        robot: the model. joints: joints that yield; empty for all.
        around: compliance at which the columns are those of the oscillating link, torque over compliance [rad/(N m)]; 0: of a
            link that follows its load at once.
        damping: of the spring over its critical value, with the link's mean inertia. links: see :class:`.compliance.Compliance`.
    """

    id = "joint_elasticity"
    label = "elastic joint"
    words = "a gear that yields under load on {where} (stiffness {stiffness})"
    setting_names = ("around", "damping", "exact")
    knobs = (Knob("damping", 0.003, 1.0, "1"),)
    deflection = DeflectionSearch(
        scanned=1.1, steps=(("damping", 0.0), ("around", 1.05), ("damping", 1.5), ("around", 1.01)), form_error=0.02
    )
    signature = "a deflection in proportion to the load, in all joints around it; brings a rotor inertia with it"
    look_alikes = ("joint_offset", "link_inertia", "torque_scale", "backlash")
    separated_by = "heavy load in both directions, and fast parts near the resonance"

    def __init__(
        self,
        robot: RobotModel,
        joints: Sequence[str] = (),
        around: float = 0.0,
        damping: float = 0.05,
        exact: bool = True,
        links: Sequence[float] = (),
    ) -> None:
        super().__init__(robot, joints, links)
        self.around, self.damping, self.exact = float(around), positive(damping, "damping", self.id), bool(exact)
        self.name_joints(("compliance",), ("rad/(N m)",))

    def lag(self, motion: Motion, joint: int) -> FloatArray:
        return deflection(motion, joint, 1.0 / self.around, self.damping, exact=self.exact)

    @classmethod
    def own_curves(cls, motion: Motion, effects: Sequence[Self]) -> FloatArray:
        if any(e.exact or e.links for e in effects):
            return super().own_curves(motion, effects)
        around = np.array([e.around for e in effects])
        damping = np.array([e.damping for e in effects])
        return np.asarray(own_torques(motion, int(effects[0].joints[0]), 1.0 / around, damping) / around[:, None])

    def fill(self, sample: Sample, out: FloatArray) -> None:
        state = sample.q[None], sample.v[None], sample.a[None]
        by_q, _, _ = self._arm.rnea_derivatives_along(*state)
        out[:] = -(by_q[0] * self._arm.rnea_along(*state)[0])[:, self.joints]

    def columns_at_once(self, motion: Motion) -> FloatArray:
        out = []
        for j in self.joints:
            load = motion.link_torque[:, j]
            rate = motion.rate_of(load)
            out.append(torque_of(motion, int(j), np.stack([load, rate, motion.rate_of(rate)], axis=1), exact=False))
        return np.stack(out, axis=-1)

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        inertia = max(float(np.mean([np.mean(m.sensitivity[2][:, joint, joint]) for m in motions])), 1e-9)
        sizes = [1.0 / (inertia * (2.0 * np.pi * float(f)) ** 2) for f in _RESONANCES]
        return [Candidate({"around": x, "damping": _DAMPING, "exact": False}) for x in sizes]

    def reference_torque(self, motions: Sequence[Motion]) -> float:
        return float(np.sqrt(np.mean([np.mean(m.link_torque[:, self.joints[0]] ** 2) for m in motions])))

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        return bool(theta[0] > 0.0 and theta[0] * torque <= _YIELDS)

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        (joint,), unit = self.joint_names, "N/m" if self.robot.is_prismatic[self.joints[0]] else "N m/rad"
        compliance = by_delta_method("compliance", joint, self.units[0], lambda x: float(x[0]), values, covariance)
        # the interval of the compliance turned over: that of the stiffness is not symmetric, and without an upper end where no
        # compliance at all is in it
        value, low = 1.0 / compliance.value, 1.0 / compliance.high
        high = 1.0 / compliance.low if compliance.low > 0.0 else None
        return [Parameter("stiffness", joint, value, unit, value**2 * compliance.std, low, high)]
