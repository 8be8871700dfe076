"""An IMU that is late."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.trunk_effect import TrunkEffect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.trunk_channels import TrunkSetup


class ImuDelay(TrunkEffect):
    """``tau = d/dt rnea(q, 0, a_trunk) d``: the IMU shows everything d [s] later than the joints do, ``a(t) = a'(t + d)``."""

    id = "imu_delay"
    label = "delay of the IMU"
    words = "the IMU is late against the joints ({sizes})"
    signature = "the whole robot's inertia runs ahead of its motion"
    look_alikes = ("imu_lever", "time_delay")
    separated_by = "quick motions of the trunk along all axes"
    expected = 0.01
    """Ten milliseconds: what drivers buffer."""
    always = 1e-3
    """Half a message of a usual IMU."""

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        self.parameter_names, self.units = ("imu_delay",), ("s",)

    def columns_along(self, motion: Motion) -> FloatArray:
        if motion.q.shape[1] <= FREE:
            return np.zeros((len(motion.t), self.robot.n, 1))
        still, moved = np.zeros_like(motion.v), np.zeros_like(motion.a)
        moved[:, :FREE] = motion.a[:, :FREE]
        return motion.rate_of(self.robot.rnea_along(motion.q, still, moved))[:, :, None]

    def as_setup(self, theta: FloatArray) -> TrunkSetup:
        return TrunkSetup(delay=float(theta[0]))

    def of_setup(self, setup: TrunkSetup) -> FloatArray:
        return np.array([setup.delay])

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.006, 0.02
