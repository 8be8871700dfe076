"""Conversions between messages and the package's values that several nodes need."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState

from sysid_ros.sample import JointStateRecord


def record_of(message: JointState, receive_time: float) -> JointStateRecord:
    """The record of a message that was received at ``receive_time`` [s]."""
    stamp = message.header.stamp
    t = stamp.sec + 1e-9 * stamp.nanosec
    return JointStateRecord(t, receive_time, tuple(message.name), message.position, message.velocity, message.effort)


def stamp_of(t: float) -> Time:
    """A time [s] as a message."""
    sec, nanosec = divmod(round(t * 1e9), 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)
