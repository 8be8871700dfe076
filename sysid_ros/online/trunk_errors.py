"""What is not known of IMU and feet of a robot on legs, as free effects beside its payload."""

from __future__ import annotations

from typing import ClassVar

from numba import njit

from sysid_ros.effects import Effect
from sysid_ros.floating.trunk_inertia import TrunkInertia
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample


class ImuPlacement(Effect):
    """``tau = M_b(q) (phi x s - dw x p - w x (w x p))``: the IMU is turned by three small angles phi [rad] against what is
    said of it, and sits p [m] away, in the axes of the trunk.

    With M_b (n, 3) the torque that a unit of specific force s of the trunk costs. What the IMU shows is the force of another
    place in other axes, and that much less is the trunk's own.

    Args:
        robot: on its floating base. inertia: of it and its load.
    """

    id: ClassVar[str] = "imu_placement"
    label: ClassVar[str] = "placement of the IMU"

    def __init__(self, robot: RobotModel, inertia: TrunkInertia) -> None:
        super().__init__(robot)
        self._inertia = inertia
        self.parameter_names = tuple(f"{what}_{axis}" for what in ("tilt", "lever") for axis in "xyz")
        self.units = ("rad",) * 3 + ("m",) * 3

    def fill(self, sample: Sample, out: FloatArray) -> None:
        _place(self._inertia.columns(sample.q), sample.v, sample.a, out)


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


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _place(mass: FloatArray, v: FloatArray, a: FloatArray, out: FloatArray) -> None:
    """``-M_b [S(s), S(dw) + S(w) S(w)]`` with S(x) y = x x y, into ``out`` (n, 6)."""
    s, w = a[:3], v[3:6]
    dx, dy, dz = a[3] + w[1] * w[2], a[4] - w[0] * w[2], a[5] + w[0] * w[1]
    xx, yy, zz, xy, xz, yz = w[0] * w[0], w[1] * w[1], w[2] * w[2], w[0] * w[1], w[0] * w[2], w[1] * w[2]
    for i in range(mass.shape[0]):
        x, y, z = mass[i, 0], mass[i, 1], mass[i, 2]
        out[i, 0] = y * -s[2] + z * s[1]
        out[i, 1] = z * -s[0] + x * s[2]
        out[i, 2] = x * -s[1] + y * s[0]
        out[i, 3] = x * (yy + zz) - y * (dz + xy) - z * (xz - dy)
        out[i, 4] = x * (dz - xy) + y * (xx + zz) - z * (dx + yz)
        out[i, 5] = y * (dx - yz) - x * (dy + xz) + z * (xx + yy)
