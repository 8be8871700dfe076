"""Conversions between messages and the package's values. They hold no mathematics beyond the order of numbers."""

from __future__ import annotations

import array
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import InertiaStamped, PoseWithCovarianceStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from sysid_ros.online.commit_gate import is_empty
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.robot.inertial_parameters import MESSAGE_NAMES, TO_MESSAGE_ORDER
from sysid_ros.sample import FloatArray, JointStateRecord

_ORDER = np.ix_(TO_MESSAGE_ORDER, TO_MESSAGE_ORDER)


class RecordReader:
    """Turns messages into records; equal names give the same tuple, so that the gate sees at once that nothing changed."""

    def __init__(self) -> None:
        self._list: list[str] = []
        self._names: tuple[str, ...] = ()

    def __call__(self, message: JointState, receive_time: float) -> JointStateRecord:
        """The record of a message that was received at ``receive_time`` [s]."""
        if message.name != self._list:
            self._list = list(message.name)
            self._names = tuple(self._list)
        stamp = message.header.stamp
        return JointStateRecord(
            stamp.sec + 1e-9 * stamp.nanosec, receive_time, self._names, message.position, message.velocity, message.effort
        )


def stamp_of(t: float) -> Time:
    """A time [s] as a message."""
    sec, nanosec = divmod(round(t * 1e9), 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


def inertia_message(estimate: PayloadEstimate, stamp: Time) -> InertiaStamped:
    """Com in the frame, tensor about the centre of mass with axes parallel to the frame; all zero where nothing is carried."""
    message = InertiaStamped()
    message.header.stamp, message.header.frame_id = stamp, estimate.frame
    if is_empty(estimate):
        return message
    inertia = message.inertia
    inertia.m = estimate.mass
    inertia.com.x, inertia.com.y, inertia.com.z = estimate.com.tolist()
    (inertia.ixx, inertia.ixy, inertia.ixz), (_, inertia.iyy, inertia.iyz), (_, _, inertia.izz) = estimate.inertia_com.tolist()
    return message


def parameters_message(estimate: PayloadEstimate) -> Float64MultiArray:
    """11 x 10: row 0 the parameters about the frame's origin, rows 1 to 10 their covariance, ordered as the second label says."""
    rows = np.empty((11, 10))
    rows[0] = estimate.theta[TO_MESSAGE_ORDER]
    rows[1:] = estimate.covariance[_ORDER]
    layout = MultiArrayLayout(
        dim=[
            MultiArrayDimension(label="estimate;covariance", size=11, stride=110),
            MultiArrayDimension(label=",".join(MESSAGE_NAMES), size=10, stride=10),
        ]
    )
    return Float64MultiArray(layout=layout, data=_doubles(rows))


def center_of_mass_message(estimate: PayloadEstimate, stamp: Time) -> PoseWithCovarianceStamped:
    """Centre of mass with its covariance; element 0 of the covariance is -1 where nothing is carried (as in sensor_msgs/Imu)."""
    message = PoseWithCovarianceStamped()
    message.header.stamp, message.header.frame_id = stamp, estimate.frame
    pose = message.pose.pose
    pose.orientation.w = 1.0
    covariance = np.zeros((6, 6))
    if is_empty(estimate):
        covariance[0, 0] = -1.0
    else:
        pose.position.x, pose.position.y, pose.position.z = estimate.com.tolist()
        covariance[:3, :3] = estimate.com_covariance
    message.pose.covariance = covariance.ravel()
    return message


def payload_effort_message(estimate: PayloadEstimate, order: Any, names: list[str]) -> Float64MultiArray:
    """Joint torques that the payload costs now, in the order of ``names``, which is the label; 0 where nothing is carried."""
    effort = np.zeros_like(estimate.payload_effort) if is_empty(estimate) else estimate.payload_effort[order]
    dimension = MultiArrayDimension(label=",".join(names), size=effort.size, stride=effort.size)
    return Float64MultiArray(layout=MultiArrayLayout(dim=[dimension]), data=_doubles(effort))


def residual_message(estimate: PayloadEstimate, stamp: Time, order: Any, names: list[str]) -> JointState:
    """Measured minus predicted torque of the joints."""
    message = JointState(name=names, effort=_doubles(estimate.residual[order]))
    message.header.stamp = stamp
    return message


def _doubles(values: FloatArray) -> array.array[float]:
    return array.array("d", np.ascontiguousarray(values, dtype=float).tobytes())
