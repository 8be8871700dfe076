"""GaitSequence: one gait after the other, the robot standing for a moment in between."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.legged_gait import LEGGED_GAITS, LeggedGait, smooth

MIXED = "mixed"
"""Name of the gait that is all others in turn."""
_LASTS = (6.0, 14.0)
"""How long each is, from, to [s]."""
_STANDS, _GOES_OVER = 0.3, 0.8
"""How long it stands after each, and in which time it goes over to the next from where its feet are [s]."""


class GaitSequence:
    """Wanted places of the feet, as :class:`.LeggedGait` gives them: of one gait, or of all in random order.

    Args:
        gait: one of :data:`.LEGGED_GAITS`, or :data:`MIXED`. feet, rng, extent, speed: as of :class:`.LeggedGait`.
    """

    def __init__(self, gait: str, feet: FloatArray, rng: np.random.Generator, extent: float, speed: float) -> None:
        self._feet, self._rng, self._asked = feet, rng, (extent, speed)
        self._mixed = gait == MIXED
        self._left: list[str] = []
        self._begin, self._until = 0.0, math.inf
        self._last, self._off = feet.copy(), np.zeros((4, 3))
        self._now = self._next(0.0) if self._mixed else LeggedGait(gait, feet, rng, extent, speed)

    @property
    def name(self) -> str:
        """Of the gait of now."""
        return self._now.gait

    @property
    def stands(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Which feet are wanted on the ground, shape (4,)."""
        return self._now.stands

    def places(
        self, t: float, period: float, velocity: FloatArray, tilt: FloatArray, ground: Callable[[FloatArray], float] | None = None
    ) -> FloatArray:
        """Contact points of the feet at t [s], in the trunk, shape (4, 3) [m]; arguments as of :meth:`.LeggedGait.places`."""
        if t >= self._until:
            self._now = self._next(t)
        out = self._now.places(t - self._begin, period, velocity, tilt, ground)
        if self._mixed:
            self._last = out + (1.0 - smooth((t - self._begin) / _GOES_OVER)) * self._off
            return self._last
        return out

    def _next(self, t: float) -> LeggedGait:
        """The gait from t [s] on."""
        if not self._left:
            self._left = [str(x) for x in self._rng.permutation(LEGGED_GAITS)]
        lasts = float(self._rng.uniform(*_LASTS))
        self._begin, self._until, self._off = t, t + lasts + _STANDS, self._last - self._feet
        return LeggedGait(self._left.pop(), self._feet, self._rng, *self._asked, end=lasts)
