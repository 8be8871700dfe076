"""TrunkTrajectory: where the trunk of a robot on legs is in a motion, as YAML of a ROS message."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class TrunkTrajectory:
    """A ``trajectory_msgs/MultiDOFJointTrajectory`` of one body, from where it stands, without velocities.

    Attributes:
        name: of the body. t: times from the start, shape (N,) [s]. position: of its origin, shape (N, 3) [m]. orientation:
            quaternions x, y, z, w, shape (N, 4); both in its own axes of standing.
    """

    name: str
    t: FloatArray
    position: FloatArray
    orientation: FloatArray

    def yaml(self, comment: str = "") -> str:
        """The message as YAML, numbers to seven decimals; ``comment``: a line above it."""
        lines = [f"# {comment}"] if comment else []
        frame = self.name.replace("'", "''")
        lines += [
            "header:",
            "  stamp: {sec: 0, nanosec: 0}",
            f"  frame_id: 'standing {frame}'",
            "joint_names:",
            f"- '{frame}'",
            "points:",
        ]
        for time, place, turn in zip(
            np.round(self.t * 1e9).astype(np.int64).tolist(), self.position, self.orientation, strict=True
        ):
            at = ", ".join(f"{axis}: {x:.7f}" for axis, x in zip("xyz", place.tolist(), strict=True))
            by = ", ".join(f"{axis}: {x:.7f}" for axis, x in zip("xyzw", turn.tolist(), strict=True))
            lines += [
                f"- transforms: [{{translation: {{{at}}}, rotation: {{{by}}}}}]",
                "  velocities: []",
                "  accelerations: []",
                f"  time_from_start: {{sec: {time // 10**9}, nanosec: {time % 10**9}}}",
            ]
        return "\n".join(lines) + "\n"
