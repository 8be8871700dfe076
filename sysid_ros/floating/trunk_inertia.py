"""TrunkInertia: what the accelerations of the trunk cost robot and load."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray


class TrunkInertia:
    """The first six columns of the mass matrix of a robot on a floating base with its load.

    Args:
        robot: on its floating base. frame: of the payload, its index.
    """

    def __init__(self, robot: RobotModel, frame: int) -> None:
        self._model = robot.with_links(np.zeros(10 * robot.n)).model
        self._data = self._model.createData()
        at = self._model.frames[frame]
        self._joint = int(at.parentJoint)
        self._placement = np.array(at.placement.rotation), np.array(at.placement.translation)
        self._link = robot.pi[10 * (self._joint - 1) : 10 * self._joint].copy()
        self._at: FloatArray | None = None
        self._columns: FloatArray = np.zeros((robot.n, FREE))

    def carry(self, load: FloatArray) -> None:
        """Take in the ten parameters of what is carried."""
        body = self._link + inertial_parameters.move(load, *self._placement)
        self._model.inertias[self._joint] = pin.Inertia.FromDynamicParameters(body)
        self._at = None

    def columns(self, q: FloatArray) -> FloatArray:
        """At positions q of all n joints, shape (n, 6) [kg], [kg m], [kg m^2]."""
        if q is not self._at:
            self._at, self._columns = q, np.ascontiguousarray(pin.crba(self._model, self._data, q)[:, :FREE])
        return self._columns
