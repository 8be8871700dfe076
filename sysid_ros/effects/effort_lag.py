"""An effort that the driver has filtered."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from sysid_ros.effects.effect import Acts, Depends, Effect
from sysid_ros.effects.parameter import Parameter, by_delta_method
from sysid_ros.effects.traits import Candidate
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.driver_filter import IS_A_DELAY, ORDERS, driver_filter
from sysid_ros.signals.motion import Motion

_LONGEST = 0.3
"""A filter that is slower hides the motion itself [s]."""
_TRIED = (0.03, 0.1)
"""Time constants that a search starts from [s]: a shorter lag is a delay within some per cent of it."""

_IN_WORDS = {1: "first", 2: "second"}


class EffortLag(Effect):
    """``tau = F(tau_drive)``: the effort is the torque of the drives behind a Butterworth low-pass F (Butterworth 1930), by whose
    lag [s] what is slow comes late.

    ``lag dtau/dt + tau = tau_drive`` is the one of order 1, with the cut-off 1 / (2 pi lag). That of order 2 has ``lag^2 / 2``
    times the second derivative beside it, and the cut-off sqrt(2) / (2 pi lag).

    Args:
        robot: the model. joints: unused, the whole arm is concerned. order: of the low-pass, 1 or 2.
        around: lag at which the columns are exact [s], ``(tau - tau_drive) / around``; at 0 they are ``-dtau_drive/dt``.
    """

    id = "effort_lag"
    label = "effort low-passed"
    words = "efforts behind a low-pass filter of the {order} order (cut-off {cutoff})"
    setting_names = ("around", "order")
    acts = Acts.MEASUREMENT
    depends_on = frozenset({Depends.DRIVE, Depends.SENSOR})
    family = "late_efforts"
    usual = 0.1
    nonnegative = True
    low_passes = True
    between = (0.0, _LONGEST)
    size = 0.05
    """Of drivers and controllers that smooth efforts at some hertz [s]."""
    signature = "the effort follows slow changes and loses fast ones, on all joints alike"
    look_alikes = ("time_delay", "viscous_friction", "joint_elasticity")
    separated_by = "fast motion: a delay keeps the height of what it moves, a low-pass does not"

    def __init__(self, robot: RobotModel, joints: Sequence[str] = (), around: float = 0.0, order: int = 1) -> None:
        super().__init__(robot, joints)
        self.around, self.order = float(around), int(order)
        self.parameter_names, self.units = ("lag",), ("s",)

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        return [Candidate({"around": x, "order": order}) for order, x in product(ORDERS, _TRIED)]

    def fill(self, sample: Sample, out: FloatArray) -> None:
        out[:] = 0.0

    def columns_along(self, motion: Motion) -> FloatArray:
        if self.around > 0.0:
            return self._lost(motion, self.around)[:, :, None] / self.around
        return np.asarray(-motion.rate_of(motion.drive_torque + motion.sensor_torque))[:, :, None]

    def torque_along(self, motion: Motion, theta: FloatArray) -> FloatArray:
        if self.around > 0.0:
            return self._lost(motion, float(theta[0])) if theta[0] > 0.0 else np.zeros_like(motion.q)
        return super().torque_along(motion, theta)

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        shortest = IS_A_DELAY if self.order > 1 else 0.0
        return bool(theta[0] + 2.0 * std[0] > shortest and theta[0] - 2.0 * std[0] < _LONGEST)

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        turns = np.sqrt(self.order) / (2.0 * np.pi)
        cutoff = by_delta_method("cutoff", None, "Hz", lambda x: turns / max(float(x[0]), 1e-6), values, covariance)
        return [cutoff, *super().as_parameters(values, covariance, basis)]

    def in_words(self, parameters: Sequence[Parameter], where: str) -> str:
        return super().in_words([*parameters, Parameter("order", None, _IN_WORDS[self.order], "")], where)

    def published(self, values: FloatArray, period: float, axis: int) -> FloatArray:
        return driver_filter(values, period / self.around, self.order, axis)

    def _lost(self, motion: Motion, lag: float) -> FloatArray:
        """What the low-pass takes away, ``tau - tau_drive``, shape (N, n) [N m]; a recording begins from rest."""
        torque = motion.drive_torque + motion.sensor_torque
        return driver_filter(torque, motion.period / lag, self.order) - torque
