"""What is published: the messages of a recording, and what lies between them and the robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

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


def low_passed(t: FloatArray, values: FloatArray, time_constant: float) -> FloatArray:
    """Values, shape (N, n), behind a low-pass of the first order, from rest; exact for straight lines between the messages."""
    out = values.copy()
    for k in range(1, len(values)):
        x = (t[k] - t[k - 1]) / time_constant
        decay = np.exp(-x)
        slope = (1.0 - decay) / x
        out[k] = decay * out[k - 1] + (1.0 - slope) * values[k] + (slope - decay) * values[k - 1]
    return out


Channel = Callable[[Signals, Signals], Signals]
"""The changed messages, from the messages so far and the robot's motion and torque without noise."""
