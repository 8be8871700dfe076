"""An IMU that sits elsewhere."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.trunk_effect import PlacementEffect, cross
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.trunk_channels import TrunkSetup


class ImuLever(PlacementEffect):
    """``tau = -M_b(q) (dw x p + w x (w x p))``: the IMU sits p [m] from where it is said to, in the axes of the trunk, and shows
    the specific force of that place."""

    id = "imu_lever"
    label = "place of the IMU"
    words = "the IMU sits elsewhere in the trunk ({sizes})"
    signature = "a force on the whole robot with the angular acceleration of the trunk"
    look_alikes = ("link_inertia", "imu_delay")
    separated_by = "turning the trunk about all axes quickly"
    expected = 0.03
    """Three centimetres: the size of its board and of what it is mounted on."""
    always = 2e-3
    """Two millimetres: what a drawing of it is read by."""

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.parameter_names, self.units = ("lever_x", "lever_y", "lever_z"), ("m",) * 3

    def force(self, w: FloatArray, dw: FloatArray, s: FloatArray) -> FloatArray:
        turn = cross(w)
        return np.asarray(-(cross(dw) + turn @ turn))

    def as_setup(self, theta: FloatArray) -> TrunkSetup:
        return TrunkSetup(lever=theta)

    def of_setup(self, setup: TrunkSetup) -> FloatArray:
        return setup.lever

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.02, 0.06
