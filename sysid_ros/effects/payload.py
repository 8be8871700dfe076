"""A body that the robot carries, fixed to a frame."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from sysid_ros.effects.effect import Acts, Effect
from sysid_ros.effects.parameter import Parameter, by_delta_method, vector
from sysid_ros.effects.traits import Candidate
from sysid_ros.effects.wording import one
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.urdf_bodies import within_reach
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

BODY_STD = np.array([30.0] + [10.0] * 3 + [3.0] * 6)
"""Size of the ten parameters of a body on an arm of 30 kg before any data [kg, kg m, kg m^2]."""
COMPACT = "compact"
"""Form of a body whose inertia is as usual: two kilograms, a hand's breadth from the frame."""
COMPACT_STD = np.array([30.0] + [10.0] * 3 + [0.02] * 6)
_SERVO = 1.0
"""What hangs on a robot whose description has hardly any links, at least [kg]."""
_SEEN = 0.5
"""Part of what is expected of a mass before any data, below which data must have brought it to be seen."""
FIRST_MOMENT = 4
"""Parameters of a compact body that data have to tell."""


def body_std(robot: RobotModel, form: str) -> FloatArray:
    """Size of the ten parameters of a body before any data [kg, kg m, kg m^2]: a mass as that of all links, or a kilogram of a
    servo without any, and a compact body's inertia as usual."""
    std: FloatArray = BODY_STD * (max(float(robot.pi[::10].sum()), _SERVO) / BODY_STD[0])
    if form == COMPACT:
        std[FIRST_MOMENT:] = COMPACT_STD[FIRST_MOMENT:]
    return std


class Payload(Effect):
    """Torque of a rigid body fixed to ``frame``: ``tau = J_frame' Y_body theta``, ten parameters about the frame's origin.

    Args:
        robot: the model.
        joints: unused, every joint up to the frame carries the payload.
        frame: name of the frame; empty for the robot's default.

    Attributes:
        frame_index: the frame in :meth:`RobotModel.payload_regressor`.

    Raises:
        RobotModelError: the URDF has no such frame.
    """

    id: ClassVar[str] = "payload"
    label: ClassVar[str] = "payload"
    words: ClassVar[str] = "the robot carries {mass} that the model lacks, with the centre of mass at {com} in '{frame}'"
    acts: ClassVar[Acts] = Acts.LINK
    inertial: ClassVar[bool] = True
    carried: ClassVar[bool] = True
    usual: ClassVar[float] = 0.2
    on_legs: ClassVar[bool] = True
    signature: ClassVar[str] = "gravity and inertial torque in all joints that carry the tool, of a body with a positive mass"
    look_alikes: ClassVar[tuple[str, ...]] = ("link_inertia", "external_force")
    separated_by: ClassVar[str] = "changes of the wrist's orientation, and accelerations"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), frame: str = "") -> None:
        super().__init__(robot, joints)
        self.frame = frame or robot.default_frame
        self.frame_index = robot.frame_id(self.frame)
        self.parameter_names = tuple(f"{name}[payload]" for name in inertial_parameters.NAMES)
        self.units = inertial_parameters.UNITS

    @property
    def settings(self) -> dict[str, Any]:
        return {"frame": self.frame}

    def fill(self, sample: Sample, out: FloatArray) -> None:
        self.robot.fill_payload_regressor(sample.q, self.frame_index, out)

    def link_columns(self) -> FloatArray | None:
        return np.stack([self.as_links(unit).ravel() for unit in np.eye(self.p)], axis=1)

    def as_links(self, theta: FloatArray) -> FloatArray:
        frame = self.robot.model.frames[self.frame_index]
        out = super().as_links(theta)
        placement = np.array(frame.placement.rotation), np.array(frame.placement.translation)
        if frame.parentJoint > 0:  # what hangs on the base is carried by no joint
            out[frame.parentJoint - 1] = inertial_parameters.move(theta, *placement)
        return out

    def columns_along(self, motion: Motion) -> FloatArray:
        return motion.payload_regressor(self.frame)

    @classmethod
    def settings_on_legs(cls, trunk: str, feet: Sequence[str]) -> dict[str, Any]:
        return {"frame": trunk}

    def candidates_on_legs(self) -> list[Candidate]:
        return self.candidates((), None)

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        return [Candidate(), Candidate(form=COMPACT)]

    def prior_std(self, form: str = "") -> FloatArray:
        return body_std(self.robot, form)

    def free_parameters(self, form: str, columns: int) -> int:
        return FIRST_MOMENT if form == COMPACT else columns

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        """A body with a mass: one that is seen is not negative."""
        seen = std[0] < _SEEN * body_std(self.robot, form)[0]
        return bool(theta[0] > 0.0 or not seen) and within_reach(self.robot, theta, std)

    def in_words(self, parameters: Sequence[Parameter], where: str) -> str:
        told = {p.name: p for p in parameters}
        if "mc" in told:
            return (
                f"the robot carries a body that the model lacks; its mass does not show in this motion, its first moment about "
                f"'{self.frame}' is {one(told['mc'])}"
            )
        return super().in_words([*parameters, Parameter("frame", None, self.frame, "")], where)

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        """Mass and centre of mass; where the mass does not show, the first moment."""
        mass = by_delta_method("mass", None, "kg", lambda x: float(x[0]), values, covariance)
        if np.sqrt(covariance[0, 0]) >= _SEEN * body_std(self.robot, "")[0]:
            return [mass, vector("mc", None, "kg m", lambda x: x[1:4], values, covariance)]
        return [mass, vector("com", None, "m", lambda x: x[1:4] / x[0], values, covariance)]

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.17 * torque, 0.34 * torque

    def drawn_on_legs(self, size: float, rng: np.random.Generator) -> FloatArray:
        """A body of a mass [kg] on the back, of the size of a fist."""
        place = np.array([*rng.uniform(-0.08, 0.08, 2), rng.uniform(0.03, 0.07)])
        return inertial_parameters.from_com(size, place, size * 1.5e-3 * np.eye(3))
