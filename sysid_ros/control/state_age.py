"""StateAge: how old a joint state is when it comes."""

from __future__ import annotations

import math
from typing import Final

_DRIFT: Final = 1e-4
"""By which two clocks may differ in rate."""


class StateAge:
    """How much later a state comes than the fastest of them does, whatever the clocks of robot and controller differ by."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The clocks may have been set."""
        self._least, self._last = math.inf, 0.0

    def of(self, stamp: float, received: float) -> float:
        """[s]

        Args:
            stamp: of the state, by the robot's clock [s]. received: by the controller's [s].
        """
        drifted = self._least + _DRIFT * max(received - self._last, 0.0)
        self._least, self._last = min(drifted, received - stamp), received
        return received - stamp - self._least
