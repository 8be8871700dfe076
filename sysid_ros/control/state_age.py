"""How old a joint state is when it comes, and how long the next may take."""

from __future__ import annotations

import math
from typing import Final

_DRIFT: Final = 1e-4
"""By which two clocks may differ in rate."""
_SET: Final = 1.0
"""A stamp that is so far ahead of the clock, or behind the stamp before, is wrong, or the clock of the robot was set [s]."""

_TO_KNOW: Final = 50
_AVERAGE: Final = 200
"""States after which their period is known, some of them lost, and over which it is averaged."""
_GRACE: Final = 3.0
"""Periods after which a state is missing."""


class StatePeriod:
    """Mean time from one joint state to the next.

    Attributes:
        mean: [s]; 0 before two states have come.
    """

    def __init__(self) -> None:
        self.mean, self._count = 0.0, 0

    def add(self, period: float) -> None:
        """Take in the time since the state before [s]. A longer one, of states that were lost, says little of the rate."""
        self._count += 1
        counted = period if self._count == 1 else min(period, self.missing)
        self.mean += (counted - self.mean) / min(self._count, _AVERAGE)

    @property
    def known(self) -> bool:
        """True where so many have come that some may have been lost."""
        return self._count > _TO_KNOW

    @property
    def missing(self) -> float:
        """Time after a state from which the next is missing [s]."""
        return _GRACE * self.mean


class StateAge:
    """How much later a state comes than the fastest of them does, whatever the clocks of robot and controller differ by.

    Where the robot's clock was set all stamps that follow tell so; a single one that does is wrong.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The clocks may have been set."""
        self._least, self._last, self._stamp, self._odd = math.inf, 0.0, -math.inf, False

    def of(self, stamp: float, received: float) -> float:
        """[s]; infinite of a state whose stamp fits none before it.

        Args:
            stamp: of the state, by the robot's clock [s]. received: by the controller's [s].
        """
        before = self._odd
        lag, least = received - stamp, self._least + _DRIFT * max(received - self._last, 0.0)
        ahead, back = self._least < math.inf and lag < least - _SET, stamp < self._stamp - _SET
        self._odd = ahead or back
        if self._odd and not before:
            return math.inf
        if self._odd:
            self.forget()
            least = lag
        self._least, self._last, self._stamp = min(least, lag), received, stamp
        return lag - self._least
