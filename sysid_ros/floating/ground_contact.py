"""GroundContact: whether a robot on legs stands, was lifted, or has just been set down."""

from __future__ import annotations

STANDS, AIRBORNE, LIFTED, SET_DOWN, STANDS_AGAIN = range(5)
"""It stands; its feet have left the ground for a moment; for long; it stands again, for how long is not known; and for good."""

_TRUSTED = 0.5
"""Part of a row that is from when the feet carried the robot, below which the row is left out."""
_SETTLES = 1.0
"""Time on the ground after which nobody is taken to hold the robot any more [s]."""


class GroundContact:
    """Follows the share of the rows that were measured on the ground.

    Who lifts a robot pulls at it before its feet are off the ground and after they are on it again, and what it carries may be
    another thing afterwards. So after it was lifted it counts as standing only when it has stood for a while, and then what was
    learned before is to be forgotten.

    Args:
        timeout: off the ground for longer than this it was lifted [s].

    Attributes:
        seconds: off the ground, or since it was set down [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._lifted = False
        self.seconds = 0.0
        self._stood = True

    @property
    def lifted(self) -> bool:
        """True from when it was lifted until it stands again."""
        return self._lifted

    @property
    def reason(self) -> str:
        """The state in a sentence."""
        if self._stood:
            return f"The robot has been set down {self.seconds:.1f} s ago; what it carries is looked for anew."
        return (
            f"For {self.seconds:.1f} s the feet have not carried the robot, or a leg was stretched; what it carries is not known "
            "any more."
        )

    def update(self, trust: float, period: float) -> int:
        """Take in the share of a row (0 to 1) that stands for ``period`` [s]; the state from then on."""
        stands = trust >= _TRUSTED
        self.seconds = period if stands != self._stood else self.seconds + period
        self._stood = stands
        if not stands:
            self._lifted = self._lifted or self.seconds > self._timeout
            return LIFTED if self._lifted else AIRBORNE
        if not self._lifted:
            return STANDS
        if self.seconds < _SETTLES:
            return SET_DOWN
        self._lifted = False
        return STANDS_AGAIN
