"""JointTrajectory: a motion as joint_trajectory_controller takes it, as YAML and in a bag."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.exceptions import BagError, DataError
from sysid_ros.sample import FloatArray
from sysid_ros.sources.bag_recorder import BagRecorder
from sysid_ros.sources.joint_state_cdr import typestore

JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
_DECIMALS = 7


@dataclass(frozen=True, slots=True)
class JointTrajectory:
    """A ``trajectory_msgs/JointTrajectory``: points that a controller passes through, with quintic splines between them.

    Attributes:
        joint_names: n names. t: times from the start, ascending, shape (N,) [s].
        q, v, a: shape (N, n) each [rad or m, a second, a second squared].

    Raises:
        DataError: shapes do not fit, a number is not finite, or times do not ascend.
    """

    joint_names: tuple[str, ...]
    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray

    def __post_init__(self) -> None:
        shape = (len(self.t), len(self.joint_names))
        if any(x.shape != shape for x in (self.q, self.v, self.a)):
            raise DataError(
                f"a trajectory of {shape[0]} points and {shape[1]} joints has positions, velocities and accelerations of shapes "
                f"{self.q.shape}, {self.v.shape} and {self.a.shape}; all must be {shape}."
            )
        if not all(np.all(np.isfinite(x)) for x in (self.t, self.q, self.v, self.a)):
            raise DataError("a trajectory holds numbers that are not finite. Every point must be known.")
        if len(self.t) == 0 or self.t[0] < 0.0 or np.any(np.diff(self._nanoseconds()) <= 0):
            raise DataError("the times of a trajectory must ascend from 0 or later. Sort the points, or leave out doubles.")

    def _nanoseconds(self) -> Any:
        return np.round(np.asarray(self.t) * 1e9).astype(np.int64)

    def yaml(self, comment: str = "") -> str:
        """The message as YAML, numbers to seven decimals.

        Args:
            comment: lines above it.
        """
        lines = [f"# {line}".rstrip() for line in comment.splitlines()]
        lines += ["header:", "  stamp: {sec: 0, nanosec: 0}", "  frame_id: ''", "joint_names:"]
        lines += [f"- {_quoted(name)}" for name in self.joint_names]
        lines.append("points:")
        for time, *rows in zip(self._nanoseconds().tolist(), self.q, self.v, self.a, strict=True):
            positions, velocities, accelerations = (", ".join(map(_number, row.tolist())) for row in rows)
            lines += [
                f"- positions: [{positions}]",
                f"  velocities: [{velocities}]",
                f"  accelerations: [{accelerations}]",
                f"  time_from_start: {{sec: {time // 10**9}, nanosec: {time % 10**9}}}",
            ]
        return "\n".join(lines) + "\n"

    def message(self) -> Any:
        """The message for :meth:`BagRecorder.write`; its stamp is 0: now."""
        types = typestore().types
        duration, stamp = types["builtin_interfaces/msg/Duration"], types["builtin_interfaces/msg/Time"]
        point = types["trajectory_msgs/msg/JointTrajectoryPoint"]
        points = [
            point(
                positions=np.array(q, dtype=np.float64),
                velocities=np.array(v, dtype=np.float64),
                accelerations=np.array(a, dtype=np.float64),
                effort=np.zeros(0),
                time_from_start=duration(sec=int(time // 10**9), nanosec=int(time % 10**9)),
            )
            for time, q, v, a in zip(self._nanoseconds().tolist(), self.q, self.v, self.a, strict=True)
        ]
        header = types["std_msgs/msg/Header"](stamp=stamp(sec=0, nanosec=0), frame_id="")
        return types[JOINT_TRAJECTORY](header=header, joint_names=list(self.joint_names), points=points)

    def write_bag(self, path: Path, topic: str, urdf: str, storage: str = "mcap", receive_time: float = 1_700_000_000.0) -> None:
        """A bag with the message and the robot's description; playing it sends the motion.

        Args:
            path: the folder to create. topic: of the message. urdf: the description. receive_time: of both [s].

        Raises:
            BagError: the folder exists, or the topic is no absolute name.
        """
        if not topic.startswith("/") or topic.endswith("/") or " " in topic:
            raise BagError(f"topic '{topic}' is no absolute name; write it as /joint_trajectory_controller/joint_trajectory.")
        with BagRecorder(path, storage) as recorder:
            recorder.write_robot_description(urdf, receive_time)
            recorder.write(topic, JOINT_TRAJECTORY, self.message(), receive_time)


def _number(value: float) -> str:
    text = f"{value:.{_DECIMALS}f}"
    # YAML readers keep the sign of -0.0
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


def _quoted(name: str) -> str:
    return "'" + name.replace("'", "''") + "'"
