"""The only data that cross the borders of modules: JointStateRecord, Measurement and Sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FREE = 6
"""Joints of the trunk of a floating base: three slides, three turns."""


@dataclass(frozen=True, slots=True)
class JointStateRecord:
    """One ``sensor_msgs/JointState`` as it was received, before anything was checked.

    Attributes:
        stamp: the message's own header stamp [s]; 0.0 where it was never filled in.
        receive_time: when the message arrived or was recorded [s].
        names: joint names in the message's order.
        position: [rad or m], any length.
        velocity: [rad/s or m/s], any length, often empty.
        effort: [N m or N], any length, often empty.
    """

    stamp: float
    receive_time: float
    names: tuple[str, ...]
    position: Sequence[float] | FloatArray
    velocity: Sequence[float] | FloatArray
    effort: Sequence[float] | FloatArray


@dataclass(frozen=True, slots=True)
class ImuRecord:
    """One ``sensor_msgs/Imu`` as it was received.

    Attributes:
        stamp: the message's own header stamp [s]. receive_time: when it arrived or was recorded [s].
        frame_id: link whose axes and origin the numbers belong to.
        orientation: of that link in the world, x, y, z, w; only written, never needed.
        omega: angular velocity, shape (3,) [rad/s]. specific_force: acceleration minus gravity, shape (3,) [m/s^2].
    """

    stamp: float
    receive_time: float
    frame_id: str
    orientation: Sequence[float] | FloatArray
    omega: Sequence[float] | FloatArray
    specific_force: Sequence[float] | FloatArray

    @classmethod
    def of(cls, message: Any, receive_time: float) -> ImuRecord:
        """From a message of rclpy or of rosbags."""
        stamp, w, f, r = message.header.stamp, message.angular_velocity, message.linear_acceleration, message.orientation
        t, axes = stamp.sec + 1e-9 * stamp.nanosec, message.header.frame_id
        return cls(t, receive_time, axes, (r.x, r.y, r.z, r.w), (w.x, w.y, w.z), (f.x, f.y, f.z))


@dataclass(frozen=True, slots=True)
class ContactRecord:
    """One array of foot contacts as it was received; it carries no stamp.

    Attributes:
        receive_time: when it arrived or was recorded [s]. values: one a foot, above 0.5 stands.
    """

    receive_time: float
    values: Sequence[float] | FloatArray


@dataclass(frozen=True, slots=True)
class TemperatureSeries:
    """The readings of one temperature sensor, as they were recorded.

    Attributes:
        topic: where they came. frame: of the message's header, or the joint's name; "" where it has none.
        t: stamps, shape (K,) [s]. values: shape (K,) [degrees Celsius].
    """

    topic: str
    frame: str
    t: FloatArray
    values: FloatArray


@dataclass(frozen=True, slots=True)
class TrunkReading:
    """What the IMU of a floating base measured, in the axes of the trunk, and which feet stand.

    Attributes:
        omega: angular velocity, shape (3,) [rad/s]. force: specific force where the IMU sits, shape (3,) [m/s^2].
        place: of the IMU in the trunk, shape (3,) [m]. contacts: 1.0 for each foot that stands, shape (k,); None where no message
            tells.
    """

    omega: FloatArray
    force: FloatArray
    place: FloatArray
    contacts: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class Measurement:
    """What the robot measured at one instant, in the model's joint order.

    Attributes:
        t: time from the message's own stamp [s].
        q: joint positions, shape (n,) [rad or m].
        v: joint velocities, shape (n,) [rad/s or m/s], or None where the robot does not measure them.
        tau: joint torques, shape (n,) [N m or N].
        trunk: of a floating base, at the same instant; else None.
    """

    t: float
    q: FloatArray
    v: FloatArray | None
    tau: FloatArray
    trunk: TrunkReading | None = None

    def __post_init__(self) -> None:
        self.q.setflags(write=False)
        self.tau.setflags(write=False)
        if self.v is not None:
            self.v.setflags(write=False)


@dataclass(frozen=True, slots=True)
class Sample:
    """A measurement with its acceleration; every channel belongs to the same instant.

    Attributes:
        t: instant that all channels belong to [s].
        q: joint positions, shape (n,) [rad or m].
        v: joint velocities, shape (n,) [rad/s or m/s].
        a: joint accelerations, shape (n,) [rad/s^2 or m/s^2].
        tau: joint torques, shape (n,) [N m or N].
        temperature: of the joints, shape (n,) [degrees Celsius], NaN where it is not known; None where none is.
    """

    t: float
    q: FloatArray
    v: FloatArray
    a: FloatArray
    tau: FloatArray
    temperature: FloatArray | None = None

    def __post_init__(self) -> None:
        self.q.setflags(write=False)
        self.v.setflags(write=False)
        self.a.setflags(write=False)
        self.tau.setflags(write=False)
        if self.temperature is not None:
            self.temperature.setflags(write=False)
