"""HeldByDrives: what the drives of a robot do where nobody commands it any more."""

from __future__ import annotations

import numpy as np

from sysid_ros.control import Reference
from sysid_ros.control.timed_motion import TimedMotion
from sysid_ros.sample import FloatArray

_BRAKING_TIME = 0.1


class HeldByDrives:
    """Brakes the joints from where they are within a tenth of a second, and holds them there.

    Attributes:
        engaged: True while the drives hold.
    """

    def __init__(self) -> None:
        self._motion: TimedMotion | None = None
        self._begin = 0.0

    @property
    def engaged(self) -> bool:
        return self._motion is not None

    def release(self) -> None:
        """Somebody commands the robot again."""
        self._motion = None

    def wanted(self, t: float, q: FloatArray, v: FloatArray) -> Reference:
        """What the drives want at t [s]; from the first call on since :meth:`release`, with the state q, v, shape (n,) each."""
        if self._motion is None:
            self._motion, self._begin = TimedMotion.braking(np.array(q), np.array(v), _BRAKING_TIME), t
        return self._motion.at(t - self._begin)
