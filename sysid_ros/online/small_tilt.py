"""SmallTilt: how far the base is tilted against the direction that gravity is set to, as an effect beside the payload."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample

_USUALLY_LEVEL = math.log(20.0)
"""Logarithm of the odds that a base is level, before any data: nineteen in twenty."""
_SURE = math.log(100.0)
"""And of those at which it is decided."""
_SMALL = 0.005
"""Up to here what is left out of an angle, half its square, is a hundred thousandth of the torque of gravity [rad]."""
_CLEAR = 9.2
"""99 % quantile of chi-squared with 2 degrees of freedom: from there on what is left of the angles is not noise."""


class SmallTilt(Effect):
    """``tau = -M_b(q) (e_k x g) phi_k`` with M_b (n, 3) the torque that a unit of acceleration of the base costs: the links are
    heavy in another direction, by two small angles [rad] about the axes e_k across gravity.

    Most bases are level, and once that is known the columns are not needed. Where one is tilted, the robot's gravity is turned by
    what was found, so that what is carried is heavy in the right direction too, and the angles are what is left. They stay free,
    because what was found is uncertain; where they grow until a small angle is none, gravity is turned again.

    Args:
        robot: the arm; its gravity may be turned. prior_std: of the angles [rad]. frame: as of :meth:`.RobotModel.frame_id`.

    Attributes:
        level: True once it is known not to be tilted. axes: e_k, shape (2, 3).
        load: what is carried at ``frame``, as it is known, shape (10,): it is heavy in another direction too.
        told: a sentence once it was found to be tilted, with what is known now.
    """

    id: ClassVar[str] = "small_tilt"
    label: ClassVar[str] = "small tilt of the base"

    def __init__(self, robot: RobotModel, prior_std: float, frame: int) -> None:
        super().__init__(robot)
        self.frame, self.load = frame, np.zeros(10)
        self._prior_std, self._set = prior_std, robot.gravity.copy()
        self.level, self.told = False, ""
        # two axes across gravity: the base's own x and y where gravity points along its z
        nearest = np.eye(3)[np.argsort(np.abs(self._set))[:2]]
        along = self._set / max(float(np.linalg.norm(self._set)), 1e-9)
        across = nearest - np.outer(nearest @ along, along)
        self.axes: FloatArray = np.linalg.qr(across.T)[0].T
        self._turned = -np.cross(self.axes, self._set).T
        self.parameter_names, self.units = ("tilt_1", "tilt_2"), ("rad", "rad")

    def fill(self, sample: Sample, out: FloatArray) -> None:
        columns = self.robot.base_acceleration_columns(sample.q)
        if self.told:
            columns += self.robot.base_acceleration_columns_of(sample.q, self.frame, self.load)
        np.matmul(columns, self._turned, out=out)

    def settle(self, theta: FloatArray, covariance: FloatArray, noise: FloatArray) -> bool:
        """Whether gravity was turned by the two parameters (2,), of the covariance (2, 2), because the base is tilted. ``noise``:
        the part of that which is no error of the links.

        What the data say for a level base is the density of the posterior at zero over that of the prior (Dickey 1971).
        """
        distance = float(theta @ np.linalg.solve(covariance, theta))
        size = 0.5 * math.log(float(np.linalg.det(covariance))) - math.log(self._prior_std**2)
        odds = _USUALLY_LEVEL - 0.5 * distance - size
        if self.told:  # zero is what was found, of which the odds say nothing; what is carried is heavy along gravity, as turned
            turns = float(theta @ theta) > _SMALL**2 and float(theta @ np.linalg.solve(noise, theta)) > _CLEAR
        else:
            self.level, turns = odds > _SURE, odds < -_SURE
        if turns or self.told:
            gravity = self._tell(theta, covariance)
        if turns:
            self.robot.gravity = gravity
            self.robot.model.gravity.linear = gravity
        return turns

    def _tell(self, theta: FloatArray, covariance: FloatArray) -> FloatArray:
        """Say how the base is tilted, by the two parameters (2,) of the covariance (2, 2) beside what gravity was turned by; the
        gravity of that, shape (3,) [m/s^2]."""
        gravity = self.robot.gravity + np.cross(theta @ self.axes, self.robot.gravity)
        gravity *= np.linalg.norm(self._set) / np.linalg.norm(gravity)
        angle = float(np.arccos(np.clip(gravity @ self._set / (self._set @ self._set), -1.0, 1.0)))
        std = math.sqrt(float(np.linalg.eigvalsh(covariance)[-1]))
        self.told = (
            f"The base is tilted by {math.degrees(angle):.1f} degrees (std {math.degrees(std):.1f}) against 'gravity'; the "
            f"payload is estimated with that. Set gravity to [{', '.join(f'{x:.2f}' for x in gravity)}], or level the base."
        )
        return np.asarray(gravity)
