"""WantedMotion: what is wanted at any time, so that torques that act late and are held can bring it about."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.control.controller import Reference
from sysid_ros.control.timed_motion import TimedMotion
from sysid_ros.sample import FloatArray

_BRAKING_WAY = 0.07
"""On which an arm without states comes to rest, unless ``braking_time`` is shorter [rad or m]."""
_BRAKING = 7.0
"""Slow joints are not braked harder than this [rad/s^2 or m/s^2]; what goes on for long without states goes astray."""
_GRID = 0.01
"""Shortest time of a motion that brakes [s]."""


@dataclass(frozen=True, slots=True)
class WantedMotion:
    """A motion, and the one that goes on until it begins.

    A motion that begins at once can't be followed: its first torque acts only when the next state has been answered, and the
    velocity that is missing by then must be made up for by the feedback. So it begins when the next torque acts.

    Attributes:
        motion: that is wanted last. begin: time at which it begins [s]. before: what is wanted until then.
    """

    motion: TimedMotion
    begin: float
    before: WantedMotion | None = None

    def at(self, t: float) -> Reference:
        """What is wanted at t [s]."""
        if t < self.begin and self.before is not None:
            return self.before.at(t)
        return self.motion.at(t - self.begin)

    def held(self, t: float, time: float) -> Reference:
        """As :meth:`at`, its acceleration that which a torque brings about that is held for ``time`` [s] about t: the mean."""
        wanted = self.at(t)
        if not time > 0.0:
            return wanted
        mean: FloatArray = (self.at(t + 0.5 * time).v - self.at(t - 0.5 * time).v) / time
        return Reference(wanted.q, wanted.v, mean)

    def then(self, motion: TimedMotion, begin: float, now: float) -> WantedMotion:
        """Another motion from ``begin`` on; what was over ``now`` is forgotten."""
        return WantedMotion(motion, begin, replace(self, before=None) if now >= self.begin else self)

    def ends_by(self, t: float) -> bool:
        """True from the end of the motion on."""
        return t - self.begin >= self.motion.end


def shortly(v: FloatArray, longest: float) -> float:
    """Time to brake in from the speeds v, shape (n,), on a short way, no harder than it asks for, at most ``longest`` [s]."""
    speed = max(float(np.abs(v).max()), 1e-9)
    return max(min(longest, 2.0 * _BRAKING_WAY / speed, speed / _BRAKING), _GRID)
