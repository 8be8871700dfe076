"""Play in a gear."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.compliance import Compliance, deflection
from sysid_ros.effects.effect import Knob, positive
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.effects.traits import Candidate, DeflectionSearch
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

WIDEST = 0.06
"""Of a gap [rad]."""
ONE_SIDED = 0.02
"""Least part of the time that a link with play lies on each side: on one flank alone it is a wrong zero and an elastic joint."""
_GAPS = np.geomspace(2e-3, WIDEST, 8)


class Backlash(Compliance):
    """``tau = ID(q - x, v - x', a - x'') - ID(q, v, a)``: the link lags behind the motor by x, half the gap while a flank
    bears it, and flies free in between (Nordin, Gutman 2002). The linear parameter is the gap [rad].

    One sample alone has the flank that its load pushes it to, ``x = sign(tau_link,j) gap / 2``; so have columns around a gap of
    zero.

    Args:
        robot: the model. joints: joints with play; empty for all. width: torque at which the side has changed [N m].
        around: gap at which the columns are exact [rad].
        flank: frequency at which the link swings on a flank, its stiffness [Hz]. damping: of that over its critical value.
        side: flank at the start of a recording: 1, -1, or 0 for the one that the load pushes to.
        links: see :class:`.compliance.Compliance`.
    """

    id = "backlash"
    label = "backlash"
    words = "play in the gear of {where} ({gap})"
    setting_names = ("width", "around", "flank", "damping", "side", "exact")
    knobs = (Knob("flank", 8.0, 60.0, "Hz"), Knob("damping", 0.05, 2.0, "1"))
    between = (0.0, np.inf)
    deflection = DeflectionSearch(
        scanned=1.5,
        steps=(("flank", 0.0), ("damping", 0.0), ("around", 1.3), ("flank", 1.5), ("around", 1.05)),
        sides=(-1, 0, 1),
        smooth=False,
        form_error=0.04,
    )
    signature = "a wrong zero that changes its sign with the load, and a link that flies free in between"
    look_alikes = ("joint_offset", "joint_elasticity")
    separated_by = "motion in which the load on the joint changes its sign"

    def __init__(
        self,
        robot: RobotModel,
        joints: Sequence[str] = (),
        width: float = 0.2,
        around: float = 0.0,
        flank: float = 20.0,
        damping: float = 0.4,
        side: int = 0,
        exact: bool = True,
        links: Sequence[float] = (),
    ) -> None:
        super().__init__(robot, joints, links)
        self.width, self.around, self.exact = positive(width, "width", self.id), float(around), bool(exact)
        self.flank, self.damping = positive(flank, "flank", self.id), positive(damping, "damping", self.id)
        if side not in (-1, 0, 1):
            raise ModelFileError(f"effect '{self.id}' has side {side!r}; it must be -1, 0 or 1.")
        self.side = int(side)
        self.name_joints(("gap",), ("rad",))

    def lag(self, motion: Motion, joint: int) -> FloatArray:
        stiffness = float(np.mean(motion.sensitivity[2][:, joint, joint])) * (2.0 * np.pi * self.flank) ** 2
        return deflection(motion, joint, stiffness, self.damping, self.around, self.side, self.exact)

    def fill(self, sample: Sample, out: FloatArray) -> None:
        state = sample.q[None], sample.v[None], sample.a[None]
        by_q, _, _ = self._arm.rnea_derivatives_along(*state)
        side = smoothed_sign(self._arm.rnea_along(*state)[0], self.width)
        out[:] = -0.5 * (by_q[0] * side)[:, self.joints]

    def columns_at_once(self, motion: Motion) -> FloatArray:
        side = smoothed_sign(motion.link_torque, self.width)
        return np.asarray(-0.5 * (motion.sensitivity[0] * side[:, None])[:, :, self.joints])

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        return [Candidate({"around": float(gap), "side": side, "exact": False}) for gap in _GAPS for side in (-1, 1)]

    def clear(self, lag: FloatArray) -> bool:
        return bool(min(np.mean(lag[:, 0] > 0.0), np.mean(lag[:, 0] < 0.0)) > ONE_SIDED)

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        (joint,) = self.joint_names
        return [by_delta_method("gap", joint, "rad", lambda x: float(x[0]), values, covariance)]
