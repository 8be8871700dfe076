"""An IMU that is turned."""

from collections.abc import Sequence

from sysid_ros.effects.trunk_effect import PlacementEffect, cross
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.trunk_channels import TrunkSetup


class ImuTilt(PlacementEffect):
    """``tau = M_b(q) (phi x s)``: the IMU is turned by three small angles phi [rad] about the axes of the trunk against what is
    said of it, so that the specific force s is shown in other axes."""

    id = "imu_tilt"
    label = "tilt of the IMU"
    words = "the IMU is turned in the trunk ({sizes})"
    signature = "the whole robot's weight points to another side, whatever the trunk does"
    look_alikes = ("accelerometer_bias", "link_inertia")
    separated_by = "rolling and pitching the trunk, and accelerating it"
    expected = 0.05
    """Three degrees: an IMU that is screwed on by eye."""
    always = 3e-3
    """A sixth of a degree: what a board has in its holes."""

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.parameter_names, self.units = ("tilt_x", "tilt_y", "tilt_z"), ("rad",) * 3

    def force(self, w: FloatArray, dw: FloatArray, s: FloatArray) -> FloatArray:
        return -cross(s)

    def as_setup(self, theta: FloatArray) -> TrunkSetup:
        return TrunkSetup(tilt=theta)

    def of_setup(self, setup: TrunkSetup) -> FloatArray:
        return setup.tilt

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.015, 0.06
