"""Conversions between the controller's messages and arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import InertiaStamped
from trajectory_msgs.msg import JointTrajectory

from sysid_ros.exceptions import DataError
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray

_MASSLESS = 1e-6


def points_of(message: JointTrajectory) -> tuple[FloatArray, FloatArray, FloatArray | None, FloatArray | None]:
    """t, q, v, a of the points, shapes (N,) and (N, n); v and a None where no point has them.

    Raises:
        DataError: a point has another number of values than there are joints.
    """
    n = len(message.joint_names)

    def table(name: str, needed: bool) -> FloatArray | None:
        rows = [list(getattr(point, name)) for point in message.points]
        if not needed and not any(rows):
            return None
        for k, row in enumerate(rows):
            if len(row) != n:
                raise DataError(f"point {k} has {len(row)} {name}; it must have {n}, one for each of joint_names.")
        return np.array(rows, dtype=float).reshape(len(rows), n)

    q = table("positions", True)
    assert q is not None
    t = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points], dtype=float)
    v = table("velocities", False)
    return t, q, v, None if v is None else table("accelerations", False)


def payload_of(message: InertiaStamped, frame: str) -> FloatArray:
    """Ten parameters about the origin of ``frame``, shape (10,); zeros where nothing is carried.

    Raises:
        DataError: the message is of another frame, or of no body that can exist.
    """
    if message.header.frame_id != frame:
        raise DataError(
            f"the payload is told in the frame '{message.header.frame_id}'; the controller's is '{frame}'. Set frame_id alike on "
            "both nodes."
        )
    i, com = message.inertia, message.inertia.com
    if abs(i.m) < _MASSLESS:
        return np.zeros(10)
    tensor = np.array([[i.ixx, i.ixy, i.ixz], [i.ixy, i.iyy, i.iyz], [i.ixz, i.iyz, i.izz]])
    theta = inertial_parameters.from_com(i.m, np.array([com.x, com.y, com.z]), tensor)
    if not np.isfinite(theta).all() or not inertial_parameters.is_physical(theta):
        raise DataError(f"a payload of {i.m:g} kg with this inertia is no body that can exist, so it was not taken over.")
    return np.asarray(theta)


def inertia_of(theta: FloatArray, frame: str, stamp: Any) -> InertiaStamped:
    """The message of ten parameters, com in the frame and the tensor about it; all zero where nothing is carried."""
    message = InertiaStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    if theta[0] > _MASSLESS:
        mass, com, tensor = inertial_parameters.to_com(theta)
        inertia = message.inertia
        inertia.m = mass
        inertia.com.x, inertia.com.y, inertia.com.z = com.tolist()
        (inertia.ixx, inertia.ixy, inertia.ixz), (_, inertia.iyy, inertia.iyz), (_, _, inertia.izz) = tensor.tolist()
    return message


def in_order(names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Indices that bring values of ``names`` into the order of ``wanted``; unchanged where that is empty."""
    return [list(names).index(name) for name in (wanted or names)]
