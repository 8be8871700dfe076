"""StateAge: how old a joint state is when it comes."""

from __future__ import annotations

import math
from typing import Final

_DRIFT: Final = 1e-4
"""By which two clocks may differ in rate."""
_SET: Final = 1.0
"""A stamp that is so far ahead of the clock, or behind the stamp before, is wrong, or the clock of the robot was set [s]."""


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
