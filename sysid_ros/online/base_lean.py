"""BaseLean: how far the base leans against the direction that gravity is set to, as an effect beside the payload."""

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


class BaseLean(Effect):
    """``tau = -M_b(q) (e_k x g) phi_k`` with M_b (n, 3) the torque that a unit of acceleration of the base costs: links, and what
    is carried, are heavy in another direction, by two small angles [rad] about the axes e_k across gravity.

    Args:
        robot: the arm. frame_index: of the frame that carries the payload.

    Attributes:
        load: ten parameters of the payload as it is estimated, shape (10,), 0 at first. axes: e_k, shape (2, 3).
        level: True once it is known not to lean; its columns are not needed any more.
    """

    id: ClassVar[str] = "base_lean"
    label: ClassVar[str] = "lean of the base"

    def __init__(self, robot: RobotModel, frame_index: int) -> None:
        super().__init__(robot)
        self._frame_index = frame_index
        self.load: FloatArray = np.zeros(10)
        self.level = False
        # two axes across gravity: the base's own x and y where gravity points along its z
        gravity = robot.gravity
        nearest = np.eye(3)[np.argsort(np.abs(gravity))[:2]]
        along = gravity / max(float(np.linalg.norm(gravity)), 1e-9)
        across = nearest - np.outer(nearest @ along, along)
        self.axes: FloatArray = np.linalg.qr(across.T)[0].T
        self._turned = -np.cross(self.axes, gravity).T
        self.parameter_names, self.units = ("lean_1", "lean_2"), ("rad", "rad")

    def fill(self, sample: Sample, out: FloatArray) -> None:
        columns = self.robot.base_acceleration_columns(sample.q)
        if self.load[0] != 0.0:
            columns += self.robot.base_acceleration_columns_of(sample.q, self._frame_index, self.load)
        np.matmul(columns, self._turned, out=out)

    def settle(self, theta: FloatArray, covariance: FloatArray, prior_std: float) -> str:
        """Whether it leans, by its two parameters (2,) with their covariance (2, 2): a sentence if so, else nothing.

        Most bases are level. What the data say for that is the density of the posterior at zero over that of the prior (Dickey
        1971).
        """
        distance = float(theta @ np.linalg.solve(covariance, theta))
        size = 0.5 * math.log(float(np.linalg.det(covariance))) - math.log(prior_std**2)
        odds = _USUALLY_LEVEL - 0.5 * distance - size
        self.level = odds > _SURE
        if self.level or odds > -_SURE:
            return ""
        angle = float(np.linalg.norm(theta))
        std = math.sqrt(float(theta @ covariance @ theta)) / angle
        gravity = self.robot.gravity + np.cross(theta @ self.axes, self.robot.gravity)
        gravity *= np.linalg.norm(self.robot.gravity) / np.linalg.norm(gravity)
        return (
            f"The base leans by {math.degrees(angle):.1f} degrees (std {math.degrees(std):.1f}) against 'gravity'; the payload "
            f"is estimated with that. Set gravity to [{', '.join(f'{x:.2f}' for x in gravity)}], or level the base."
        )
