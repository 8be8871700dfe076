"""An effort that comes late."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, Effect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.driver_filter import IS_A_DELAY
from sysid_ros.signals.motion import Motion

_LONGEST = 0.2
"""A longer delay is no delay of a measurement [s]."""
_SAMPLING = 3e-3
"""A shorter one comes from sampling: the effort is held between two samples [s]."""


class TimeDelay(Effect):
    """``tau = tau_drive(t - delay)``: the effort belongs to an earlier instant than the positions [s].

    With the measured torque advanced by ``around``, ``tau(t + around)``, every other column is exact where it stands, and only
    what the delay differs from ``around`` is to first order. The rows stay as they are: what the advance changes is a correction
    of them by :meth:`correction_along`, less what the columns here have of it. What would have been measured after the end of a
    recording (or before its start) is nowhere: the model's own torque stands there, with what is
    left of the rows in an equal time beside it.

    One sample alone does not tell how fast its torque changes; its columns are zero, those of a whole recording are not.

    Args:
        robot: the model. joints: unused, the whole arm is concerned.
        around: delay by which the measured torque is advanced [s]; the columns of a recording are
            ``(tau_drive(t) - tau_drive(t + around)) / around`` then, and ``-dtau_drive/dt`` at 0.
    """

    id = "time_delay"
    label = "effort late"
    words = "efforts that come late ({delay})"
    setting_names = ("around",)
    acts = Acts.MEASUREMENT
    on_legs = True
    depends_on = frozenset({Depends.DRIVE})
    family = "late_efforts"
    usual = 0.2
    corrects = True
    between = (-_LONGEST, _LONGEST)
    signature = "in proportion to the rate of the torque, with one delay for all joints"
    look_alikes = ("effort_lag", "viscous_friction", "joint_elasticity", "velocity_lag")
    separated_by = "fast motion: a delay grows with the square of the frequency, friction does not"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), around: float = 0.0) -> None:
        super().__init__(robot, joints)
        self.around = float(around)
        self.parameter_names, self.units = ("delay",), ("s",)

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:] = 0.0

    def columns_along(self, motion: Motion) -> FloatArray:
        if self.around:
            return np.asarray(-_advanced(motion, motion.drive_torque, self.around) / self.around)[:, :, None]
        return np.asarray(-motion.rate_of(motion.drive_torque))[:, :, None]

    def same_torque(self, theta: FloatArray, motions: Sequence[Motion]) -> tuple[str, ...]:
        """A filter of the second order with a cut-off above what is judged is a delay."""
        return ("effort_lag",) if _SAMPLING < theta[0] < IS_A_DELAY else ()

    def usual_on_legs(self, torque: float) -> float:
        return 0.5 * _SAMPLING

    def correction_along(self, motion: Motion) -> FloatArray | None:
        if not self.around:
            return None
        ahead, late = motion.t + self.around, motion.tau - motion.drive_torque
        known = motion.sensor_torque - _advanced(motion, motion.drive_torque, self.around) - late
        moved = _advanced(motion, late, self.around)
        measured = (ahead >= motion.t[0]) & (ahead <= motion.t[-1])
        near = measured & ((ahead >= motion.t[-1] - self.around) if self.around > 0.0 else (ahead <= motion.t[0] - self.around))
        left = np.mean((moved - known)[near], axis=0) if near.any() else 0.0
        return np.where(measured[:, None], moved, known + left)

    def torque_along(self, motion: Motion, theta: FloatArray) -> FloatArray:
        return _advanced(motion, motion.drive_torque, -float(theta[0])) if self.around else super().torque_along(motion, theta)

    def as_delay(self, theta: FloatArray) -> float:
        return float(theta[0])

    def notable(self, theta: FloatArray) -> bool:
        return abs(float(theta[0])) >= _SAMPLING

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.01, 0.025


def _advanced(motion: Motion, torque: FloatArray, by: float) -> FloatArray:
    """``torque(t + by) - torque(t)``, shape (N, n): beyond the ends of a recording a torque is what it is there."""
    moved = [np.interp(motion.t + by, motion.t, x) for x in torque.T]
    return np.asarray(np.stack(moved, axis=1) - torque)
