"""The only data that cross the borders of modules: JointStateRecord, Measurement and Sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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
class Measurement:
    """What the robot measured at one instant, in the model's joint order.

    Attributes:
        t: time from the message's own stamp [s].
        q: joint positions, shape (n,) [rad or m].
        v: joint velocities, shape (n,) [rad/s or m/s], or None where the robot does not measure them.
        tau: joint torques, shape (n,) [N m or N].
    """

    t: float
    q: FloatArray
    v: FloatArray | None
    tau: FloatArray

    def __post_init__(self) -> None:
        for array in (self.q, self.v, self.tau):
            if array is not None:
                array.setflags(write=False)


@dataclass(frozen=True, slots=True)
class Sample:
    """A measurement with its acceleration; every channel belongs to the same instant.

    Attributes:
        t: instant that all channels belong to [s].
        q: joint positions, shape (n,) [rad or m].
        v: joint velocities, shape (n,) [rad/s or m/s].
        a: joint accelerations, shape (n,) [rad/s^2 or m/s^2].
        tau: joint torques, shape (n,) [N m or N].
    """

    t: float
    q: FloatArray
    v: FloatArray
    a: FloatArray
    tau: FloatArray

    def __post_init__(self) -> None:
        for array in (self.q, self.v, self.a, self.tau):
            array.setflags(write=False)
