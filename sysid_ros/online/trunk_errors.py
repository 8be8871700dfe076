"""What is not known of IMU and feet of a robot on legs, as free effects beside its payload."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray, Sample


class ImuPlacement(Effect):
    """``tau = M_b(q) (phi x s - dw x p - w x (w x p))``: the IMU is turned by three small angles phi [rad] against what is
    said of it, and sits p [m] away, in the axes of the trunk.

    With M_b (n, 3) the torque that a unit of specific force s of the trunk costs. What the IMU shows is the force of another
    place in other axes, and that much less is the trunk's own.

    Args:
        robot: on its floating base. frame: of the payload, which is accelerated too.

    Attributes:
        load: the payload's ten parameters, shape (10,), as they are known.
    """

    id: ClassVar[str] = "imu_placement"
    label: ClassVar[str] = "placement of the IMU"

    def __init__(self, robot: RobotModel, frame: str) -> None:
        super().__init__(robot)
        self._frame = robot.frame_id(frame)
        self.load: FloatArray = np.zeros(10)
        self._at: FloatArray | None = None
        self._mass: FloatArray = np.zeros((robot.n, 3))
        self.parameter_names = tuple(f"{what}_{axis}" for what in ("tilt", "lever") for axis in "xyz")
        self.units = ("rad",) * 3 + ("m",) * 3

    def fill(self, sample: Sample, out: FloatArray) -> None:
        mass = self.mass(sample.q)
        w, s = sample.v[3:FREE], sample.a[:3]
        dw = sample.a[3:FREE] + np.array([w[1] * w[2], -w[0] * w[2], w[0] * w[1]])
        turn = _cross(w)
        out[:, :3] = -mass @ _cross(s)
        out[:, 3:] = -mass @ (_cross(dw) + turn @ turn)

    def mass(self, q: FloatArray) -> FloatArray:
        """M_b, of robot and load, shape (n, 3)."""
        if q is not self._at:
            self._at, self._mass = q, self.robot.base_acceleration_columns(q)
            if self.load.any():
                self._mass = self._mass + self.robot.base_acceleration_columns_of(q, self._frame, self.load)
        return self._mass


class RowEffect(Effect):
    """One parameter whose column is made of the rows behind the projection, by :class:`.TrunkRows`."""

    def __init__(self, robot: RobotModel) -> None:
        super().__init__(robot)
        self.parameter_names, self.units = (self.id,), (self.unit,)

    unit: ClassVar[str]

    def fill(self, sample: Sample, out: FloatArray) -> None:
        """Nothing."""


class FootRadius(RowEffect):
    """By how much farther below their frames the feet touch the ground than is said [m]."""

    id, label, unit = "foot_radius", "radius of the feet", "m"


class ImuDelay(RowEffect):
    """By how much the IMU shows everything later than the joints do [s]."""

    id, label, unit = "imu_delay", "delay of the IMU", "s"


def _cross(x: FloatArray) -> FloatArray:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])
