"""Cadence: how fast measurements come, and when what was made for that no longer fits."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.sample import Measurement

FIRST = 25
"""Measurements from which rate and noise of the torque are read before anything is estimated."""
_LONGEST_STEP = 1.0
"""Longest time between measurements while the rate is not known [s]."""
_SHORTEST_PERIOD = 5e-5
"""Measurements do not come faster, whatever their stamps say [s]."""
_CHECK_EVERY = 300
"""Measurements after which the rate is looked at again."""
_LONGEST_FILL = 10.5
"""Longest step that is interpolated over [periods]."""


class Cadence:
    """Reads the period between measurements from the first of them, and watches that it stays.

    Args:
        max_gap: a longer step between measurements breaks the row of them [s].
    """

    def __init__(self, max_gap: float) -> None:
        self._max_gap = max_gap
        self._last_t = -math.inf
        self.restart()

    def restart(self) -> None:
        """Forget the rate; the next measurement is a first one."""
        self._first: list[Measurement] = []
        self._period = 0.0
        self._longest_step = math.inf
        self._since_check, self._checked_t = 0, 0.0

    def follows(self, t: float) -> bool:
        """Take in a stamp [s]. False where it does not follow the ones before: time jumped, there was a gap, or measurements come
        at another rate than the first of them did, as after a burst."""
        step, self._last_t = t - self._last_t, t
        if not 0.0 < step <= self._longest_step:
            return False
        self._since_check += 1
        return self._since_check < _CHECK_EVERY or self._keeps_rate(t)

    def first(self, measurement: Measurement) -> list[Measurement]:
        """Take in one of the first measurements; all of them, once there are enough to know the rate."""
        self._longest_step = _LONGEST_STEP
        self._first.append(measurement)
        if len(self._first) < FIRST:
            return []
        first, self._first = self._first, []
        self._period = max(float(np.median(np.diff([m.t for m in first]))), _SHORTEST_PERIOD)
        self._since_check, self._checked_t = 0, measurement.t
        self._longest_step = max(min(self._max_gap, _LONGEST_FILL * self._period), 3.5 * self._period)
        return first

    @property
    def period(self) -> float:
        """Usual time between measurements, once known [s]."""
        return self._period

    def _keeps_rate(self, t: float) -> bool:
        faster = self._since_check * self._period / (t - self._checked_t)
        self._since_check, self._checked_t = 0, t
        return 0.6 < faster < 1.4
