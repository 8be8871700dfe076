"""SourceClock: the clock that measurements were taken by, learned live, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from sysid_ros.input_gate import clock_kernel as kernel
from sysid_ros.sample import Measurement

_FEWEST: Final = 3
"""Repeats that make two beats, the least that shows one to be like the other."""
_SAID: Final = 0.01
"""Part of a step that stamps are off by at least where it is worth a word: less moves no torque."""


class SourceClock:
    """The clock that the measurements of n joints were taken by.

    Attributes:
        state: what :func:`.clock_kernel.own_time` works on.
    """

    def __init__(self, n: int) -> None:
        self.state = np.zeros(20), np.zeros((5, 2 + 2 * n)), np.zeros(n), np.zeros((2, 5))
        self._usual = 0.0

    def begin(self, first: Sequence[Measurement]) -> float:
        """Start with the first measurements after an interruption, which are not taken in yet: period of their values, without
        repeated ones [s]. What is known of the share stays known."""
        clock = self.state[0]
        steps = np.diff([m.t for m in first])
        new = [np.any(b.q != a.q) or np.any(b.tau != a.tau) for a, b in pairwise(first)]
        self._usual = period = float(np.median(steps))
        if sum(new) >= kernel.BEFORE:
            at = np.array([first[0].t, *(m.t for m, differs in zip(first[1:], new, strict=True) if differs)])
            steps = np.diff(at)
            period = float(np.median(steps))
        clock[[kernel.COUNT, kernel.OFF, kernel.FORMER, kernel.ROW, kernel.OFFSET, kernel.SHIFT, kernel.HELD]] = 0.0
        clock[[kernel.BEAT, kernel.BEATS, kernel.BEGAN, kernel.POLL]] = 0.0, -1.0, first[0].t, 0.0
        clock[kernel.PERIOD] = period
        clock[kernel.VARIANCE] = 0.5 * (float(np.median(np.abs(steps - period))) / 0.6745) ** 2
        return period

    @property
    def off(self) -> float:
        """Errors of the stamps that were corrected of late, as far as they differ from one to the next (rms) [s]."""
        return float(np.sqrt(self.state[0][kernel.POWER]))

    @property
    def repeated(self) -> int:
        """Messages that repeated the one before and were left out."""
        return int(self.state[0][kernel.REPEATED])

    @property
    def period(self) -> float:
        """Time between values [s]."""
        return float(self.state[0][kernel.PERIOD])

    def in_words(self) -> str:
        """What was found, empty where the stamps are in order."""
        said = [f"{self.repeated} messages repeat the one before and were left out."] if self.repeated else []
        if self.repeated >= _FEWEST and self.state[0][kernel.SHARE] > 0.5:
            age = f"values are up to {1e3 * self._usual:.2g} ms older than the stamps"
            said.append(f"All come from a slower source of {1.0 / self.period:.4g} Hz, {age}, and were put to even times.")
        elif self.off > _SAID * self.period:
            shown = "as the positions of all joints at once show"
            said.append(f"The stamps are off by {1e3 * self.off:.2g} ms (rms), {shown}, and were corrected.")
        return " ".join(said)
