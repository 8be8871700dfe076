"""A torque that depends on the joint's position: a cable, a hose, a balancer."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import Acts, JointCurves
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.effects.traits import Candidate
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_REST = 2.0 * np.pi
"""Furthest from a joint's zero that a spring along a line rests [rad or m]: what is as large further on is an offset."""


class Spring(JointCurves):
    """``tau_j = k (q - q0)`` for a cable ("line"), ``tau_j = k sin(q - q0)`` for a balancer ("sine") [N m].

    Linear parameters: the torque at q = 0 and its slope k; for the sine the parts along sin q and cos q.

    Args:
        robot: the model. joints: joints with a spring; empty for all. shape: "line" or "sine".
    """

    id = "spring"
    label = "spring, cable or balancer"
    words = "a spring, cable or balancer on {where} that the model lacks ({k})"
    setting_names = ("shape",)
    acts = Acts.LINK
    symbols = ("along", "across")
    symbol_units = ("N m/rad", "N m")
    share = 0.2
    signature = "a straight line or a sinusoid against the joint's own position, at any speed"
    look_alikes = ("link_inertia", "torque_offset", "joint_offset", "payload")
    separated_by = "more than 1.5 rad of the joint, with the joints beyond it in several postures"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), shape: str = "line") -> None:
        super().__init__(robot, joints)
        if shape not in ("line", "sine"):
            raise ModelFileError(f"effect '{self.id}' has shape {shape!r}; it must be 'line' or 'sine'.")
        self.shape = shape

    def curves(self, state: Sample | Motion, load: FloatArray) -> FloatArray:
        if self.shape == "line":
            return np.stack([state.q, np.ones_like(state.q)])
        return np.stack([np.sin(state.q), np.cos(state.q)])

    def prior_std(self, form: str = "") -> FloatArray:
        """A spring that the motor could not hold, a radian from where it rests, would move the joint."""
        return np.repeat(self.robot.effort_limit[self.joints], len(self.symbols))

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        slope, level = np.abs(theta) + 2.0 * std * np.array([1.0, -1.0])
        return self.shape != "line" or bool(level <= _REST * slope)

    @property
    def form(self) -> str:
        return self.shape

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        slides = joint is not None and bool(motions) and bool(motions[0].robot.is_prismatic[joint])
        return [Candidate({"shape": shape}) for shape in (("line",) if slides else ("line", "sine"))]

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        (joint,) = self.joint_names
        if self.shape == "line":
            k = by_delta_method("k", joint, self.units[0], lambda x: float(x[0]), values, covariance)
            return [k, by_delta_method("q0", joint, "rad", lambda x: float(-x[1] / x[0]), values, covariance)]
        k = by_delta_method("k", joint, self.units[1], lambda x: float(np.hypot(x[0], x[1])), values, covariance)
        q0 = by_delta_method("q0", joint, "rad", lambda x: float(np.arctan2(-x[1], x[0])), values, covariance)
        return [k, q0]
