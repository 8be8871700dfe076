"""Conversions between the controller's messages and arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import InertiaStamped
from rclpy.subscription import Subscription
from trajectory_msgs.msg import JointTrajectory

from sysid_ros.exceptions import DataError
from sysid_ros.nodes.messages import body_of
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray, JointStateRecord

MASSLESS = 1e-6
"""Less than this is no payload [kg]."""


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
            f"the payload is given in the frame '{message.header.frame_id}'; the controller's is '{frame}'. Set frame_id alike "
            "on both nodes."
        )
    mass, com, tensor = body_of(message)
    if abs(mass) < MASSLESS:
        return np.zeros(10)
    theta = inertial_parameters.from_com(mass, com, tensor)
    if not np.isfinite(theta).all() or not inertial_parameters.is_physical(theta):
        raise DataError(f"a payload of {mass:g} kg with this inertia is no body that can exist, so it was not taken over.")
    return np.asarray(theta)


def in_order(names: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Indices that bring values of ``names`` into the order of ``wanted``; unchanged where that is empty."""
    return [list(names).index(name) for name in (wanted or names)]


def without_efforts(record: JointStateRecord) -> JointStateRecord:
    """A state in which the velocities stand for the efforts: who moves an arm need not know what it measures, and may not lose it
    over efforts that are absent, NaN or stuck; that the velocities are alive it must know."""
    complete = len(record.velocity) == len(record.position)
    return replace(record, effort=record.velocity if complete else np.zeros(len(record.position)))


def poll(subscription: Subscription) -> Any | None:
    """The message that a subscription has ready, taken past the executor, as where a callback waits for it; or None."""
    with subscription.handle:
        taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    return None if taken is None else taken[0]
