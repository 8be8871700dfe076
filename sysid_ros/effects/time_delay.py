"""An effort that comes late."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, Effect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_LONGEST = 0.2
"""A longer delay is no delay of a measurement [s]."""
_SAMPLING = 3e-3
"""A shorter one comes from sampling: the effort is held between two samples [s]."""


class TimeDelay(Effect):
    """``tau = -delay dtau_link/dt``, to first order: the effort belongs to an earlier instant than the positions [s].

    One sample alone does not tell how fast its torque changes; its columns are zero, those of a whole recording are not.

    Args:
        robot: the model. joints: unused, the whole arm is concerned.
        around: delay at which the columns of a recording are exact, ``(tau(t - around) - tau(t)) / around`` [s].
    """

    id = "time_delay"
    label = "effort late"
    words = "efforts that come late ({delay})"
    setting_names = ("around",)
    acts = Acts.MEASUREMENT
    on_legs = True
    depends_on = frozenset({Depends.DRIVE})
    usual = 0.2
    between = (-_LONGEST, _LONGEST)
    signature = "in proportion to the rate of the torque, with one delay for all joints"
    look_alikes = ("viscous_friction", "joint_elasticity", "velocity_lag")
    separated_by = "fast motion: a delay grows with the square of the frequency, friction does not"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), around: float = 0.0) -> None:
        super().__init__(robot, joints)
        self.around = float(around)
        self.parameter_names, self.units = ("delay",), ("s",)

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:] = 0.0

    def columns_along(self, motion: Motion) -> FloatArray:
        if self.around:
            drive = motion.drive_torque
            earlier = [np.interp(motion.t - self.around, motion.t, drive[:, j]) for j in range(self.robot.n)]
            return np.asarray((np.stack(earlier, axis=1) - drive) / self.around)[:, :, None]
        return np.asarray(-motion.rate_of(motion.drive_torque))[:, :, None]

    def usual_on_legs(self, torque: float) -> float:
        return 0.5 * _SAMPLING

    def as_delay(self, theta: FloatArray) -> float:
        return float(theta[0])

    def notable(self, theta: FloatArray) -> bool:
        return abs(float(theta[0])) >= _SAMPLING
