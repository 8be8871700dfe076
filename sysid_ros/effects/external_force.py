"""A steady force on the last link."""

from collections.abc import Sequence

from sysid_ros.effects.effect import Acts, Effect
from sysid_ros.effects.parameter import Parameter, vector
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion


class ExternalForce(Effect):
    """``tau = -J' f``: a force f on the origin of a frame, fixed in the world [N].

    Args:
        robot: the model. joints: unused, every joint up to the frame feels it. frame: where it acts; empty for the default.
    """

    id = "external_force"
    label = "external force"
    words = "a steady force on the last link, {force} in the axes of the base"
    setting_names = ("frame",)
    acts = Acts.LINK
    size = 5.0
    """Of the pull of a hose or a cable, a lean, a hand that rests on the arm [N]."""
    signature = "as a weight that keeps its direction in the world, without any inertia"
    look_alikes = ("payload", "base_tilt", "payload_change")
    separated_by = "changes of the wrist's orientation, and accelerations, which only a mass answers"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), frame: str = "") -> None:
        super().__init__(robot, joints)
        self.frame = frame or robot.default_frame
        self._frame_index = robot.frame_id(self.frame)
        self.parameter_names, self.units = ("force_x", "force_y", "force_z"), ("N", "N", "N")

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:] = -self.robot.frame_jacobian_along(sample.q[None], self._frame_index)[0].T

    def columns_along(self, motion: Motion) -> FloatArray:
        return -self.robot.frame_jacobian_along(motion.q, self._frame_index).swapaxes(1, 2)

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        return [vector("force", None, "N", lambda x: x[:3], values, covariance)]
