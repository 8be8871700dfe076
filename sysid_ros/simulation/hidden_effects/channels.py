"""What is published: the messages of a recording, and what lies between them and the robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Signals:
    """All messages of a recording: t (N,) [s] since the first, q [rad], v [rad/s], tau [N m] of shape (N, n)."""

    t: FloatArray
    q: FloatArray
    v: FloatArray
    tau: FloatArray

    def with_tau(self, tau: FloatArray) -> Signals:
        """The same motion with other efforts."""
        return replace(self, tau=tau)


Channel = Callable[[Signals, Signals], Signals]
"""The changed messages, from the messages so far and the robot's motion and torque without noise."""
