"""Feet that touch the ground elsewhere than the description says."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.effects.traits import Candidate
from sysid_ros.effects.trunk_effect import TrunkEffect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.urdf_bodies import beyond_joint
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.trunk_channels import TrunkSetup

_OTHER = 0.05
"""Usual size of an error that is a cause, over the length of the lower leg: feet of another make, or worn ones, of a radius that
is a tenth of that length."""
_GONE, _THICKEST = 0.1, 0.15
"""Over the same length: a foot that is worn down to its centre, and by how much one is thicker that is a quarter of the leg."""

_EACH = "each"
"""Form in which each foot has its own."""


class FootRadius(TrunkEffect):
    """``tau = -d(N' tau)/dr dr``: each foot touches the ground dr [m] farther below its frame than is said, so that the force
    on it has another lever, see :class:`sysid_ros.floating.feet_along.FeetAlong`.

    Args:
        robot: on its floating base. joints: unused. feet: names of the feet, in the order of the motion's.

    Attributes:
        unsure: standard deviation of each before any data, shape (k,) [m].
    """

    id = "foot_radius"
    label = "radius of the feet"
    words = "the feet touch the ground elsewhere than the description says ({sizes})"
    setting_names = ("feet",)
    signature = "the force on a foot with a lever that it should not have"
    look_alikes = ("torque_scale", "joint_offset")
    separated_by = "swaying, by which the forces on the feet change their direction in the legs"
    expected = 1.5e-3
    """By how much feet are pressed together, where the description tells what they are; who knows less says so in ``unsure``."""
    always = expected

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), feet: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.feet = list(feet)
        self.parameter_names = tuple(f"dr[{foot}]" for foot in self.feet)
        self.units = ("m",) * len(self.feet)
        self.unsure: FloatArray = np.full(len(self.feet), self.expected)

    def prior_std(self, form: str = "") -> FloatArray:
        return _OTHER * self._lower_legs(form) if form else self.unsure

    def _lower_legs(self, form: str) -> FloatArray:
        """Their lengths, shape (k,) [m]; of a form of one parameter the mean of its feet's, shape (1,)."""
        own = [form] if form in self.feet else self.feet
        each = np.array([beyond_joint(self.robot, foot) for foot in own])
        return each if form == _EACH else each.mean(keepdims=True)

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        """A foot is no hole, and no ball that a leg could not lift."""
        leg = self._lower_legs(form or _EACH)
        return bool(np.all((theta + 2.0 * std > -_GONE * leg) & (theta - 2.0 * std < _THICKEST * leg)))

    def usual_on_legs(self, torque: float) -> FloatArray | float:
        return self.unsure

    @classmethod
    def settings_on_legs(cls, trunk: str, feet: Sequence[str]) -> dict[str, Any]:
        return {"feet": list(feet)}

    def candidates_on_legs(self) -> list[Candidate]:
        each = np.eye(len(self.feet))
        one = [Candidate(basis=column[:, None], form=foot) for foot, column in zip(self.feet, each, strict=True)]
        return [*one, Candidate(basis=np.ones((len(self.feet), 1)), form="all alike"), Candidate(basis=each, form=_EACH)]

    def columns_along(self, motion: Motion) -> FloatArray:
        out = np.zeros((len(motion.t), self.robot.n, self.p))
        if motion.by_radius is not None:
            out[:, :FREE] = -motion.by_radius
        return out

    def as_setup(self, theta: FloatArray) -> TrunkSetup:
        return TrunkSetup(radius=dict(zip(self.feet, theta.tolist(), strict=True)))

    def of_setup(self, setup: TrunkSetup) -> FloatArray:
        return np.array([setup.radius.get(foot, 0.0) for foot in self.feet])

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return float(0.04 * self._lower_legs("").mean()), float(0.07 * self._lower_legs("").mean())

    def drawn_on_legs(self, size: float, rng: np.random.Generator) -> FloatArray:
        """All feet alike."""
        return np.full(len(self.feet), size)
