"""An accelerometer that shows more than there is."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import Acts, Effect
from sysid_ros.effects.traits import Candidate
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.shown_gravity import ShownGravity
from sysid_ros.signals.trunk_channels import TrunkSetup

USUAL = 0.1
"""Standard deviation of a bias that is nothing unusual [m/s^2]."""
_LEFT = 0.04
"""The same where an IMU's driver has taken out what it shows at rest: what a change of its temperature leaves [m/s^2]."""
_CAUSE, _WRONG = "cause", 1.0
"""Form of one that is a cause, and its usual size [m/s^2]: a tenth of gravity."""


class AccelerometerBias(Effect):
    """``tau = -M_b(q) b``: the specific force of the base is measured too large by a constant b in the axes of the base [m/s^2].

    With M_b (n, 3) the torque that a unit of specific force costs. Inverse dynamics with ``s + b`` asks for ``M_b b`` more than
    acts. On a robot on legs ``s`` is measured; on an arm, whose base rests, it is minus the model's gravity, and b what that is
    wrong by. Standing still, the part of b along gravity is a mass like any other; across it, no body looks like it.

    Args:
        robot: the model. joints: unused, all links are concerned. frame: of a body that is carried too; empty: none.

    Attributes:
        expected: mean and standard deviation before any data, shape (3,) each [m/s^2], changed by who knows more.
        wrong: size of one that is a cause, about 0, shape (3,) [m/s^2]; along gravity what the size of that is shown to be off.
        load: ten parameters of that body about the frame's origin, shape (10,), 0 at first: it is as heavy by ``s + b`` as the
            links are.
    """

    id = "accelerometer_bias"
    label = "bias of the accelerometer"
    words = "a bias of the accelerometer ({sizes})"
    setting_names = ("frame",)
    acts = Acts.LINK
    on_legs = True
    signature = "a force that keeps its direction in the base while the base turns, on all links by their mass"
    look_alikes = ("base_tilt", "payload", "external_force")
    separated_by = "rolling and pitching the base, by which gravity turns against the bias"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), frame: str = "") -> None:
        super().__init__(robot, joints)
        self.frame = frame
        self._frame_index = robot.frame_id(frame) if frame else None
        self.load: FloatArray = np.zeros(10)
        self.expected: tuple[FloatArray, FloatArray] = np.zeros(3), np.full(3, USUAL)
        self.wrong: FloatArray = np.full(3, _WRONG)
        self.parameter_names, self.units = ("bias_x", "bias_y", "bias_z"), ("m/s^2",) * 3

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:] = -self.robot.base_acceleration_columns(sample.q)
        if self._frame_index is not None and self.load.any():
            out -= self.robot.base_acceleration_columns_of(sample.q, self._frame_index, self.load)

    def prior_std(self, form: str = "") -> FloatArray:
        return self.wrong if form == _CAUSE else self.expected[1]

    def see_gravity(self, shown: ShownGravity) -> None:
        self.expected, self.wrong = shown.bias(USUAL), np.hypot(*shown.bias(_WRONG))

    def candidates_on_legs(self) -> list[Candidate]:
        return [Candidate(form=_CAUSE)]

    def usual_on_legs(self, torque: float) -> float:
        return _LEFT

    @property
    def nominal(self) -> FloatArray:
        return self.expected[0]

    def as_setup(self, theta: FloatArray) -> TrunkSetup:
        return TrunkSetup(bias=theta)

    def of_setup(self, setup: TrunkSetup) -> FloatArray:
        return setup.bias

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        return []  # an arm has no accelerometer: its base is tilted

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.2, 0.6
