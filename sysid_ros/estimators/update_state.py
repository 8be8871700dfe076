"""UpdateState: all that one compiled update reads and changes, in one array, so that a call takes one argument for it."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

SPREAD, NOISE, FLOOR = range(3)
"""Rows of ``levels``, shape (3, m): total variance of the innovations, variance that weighs a row, and the least of both."""
FILLED, LENGTH = range(2)
"""Rows of ``progress``, shape (2, number of lengths): updates in each block so far, and in a full one."""
PERIOD, COLOUR = 4, 5
"""Where in ``memory`` stand the time between updates [s], and for how many rows what is added to the noise of one stays."""
_SIZES: Final = 6
"""Values at the beginning of ``memory``: p, m, c, the number of lengths, and these."""


class UpdateState:
    """What :func:`.variable_update.take_in` works on: p parameters, m rows, c considered errors, l lengths of blocks.

    Args:
        p, m, c: sizes. lengths: rows a block, a level, shape (l,). period, colour: see :data:`PERIOD`.

    Attributes:
        memory: everything, shape (k,); the others are views of it.
        theta, P, S: estimate (p,), covariance (p, p), derivative by the considered errors (p, c).
        rows: sums of each row, shape (m, p, p + 1 + c), see :class:`.RowSums`.
        levels: shape (3, m), see :data:`SPREAD`.
        total, starts, known, progress: see :func:`.variable_update.add_to_blocks` and :data:`FILLED`.
    """

    def __init__(self, p: int, m: int, lengths: FloatArray, period: float, colour: float, c: int = 0) -> None:
        levels = lengths.size
        beside = 3 * m + m * (p + 2) * (levels + 1) + levels * p * (p + 1) + 2 * levels + 2 * p + c + 2 * m
        self.memory = np.zeros(_SIZES + p * (1 + p + c) + m * p * (p + 1 + c) + beside)
        self.memory[:_SIZES] = p, m, c, levels, period, colour
        self._look()
        self.progress[LENGTH] = lengths

    def _look(self) -> None:
        (
            self.theta, self.P, self.S, self.rows, self.levels, self.total, self.starts, self.known, self.progress, _
        ) = parts(self.memory)  # fmt: skip

    def considering(self, c: int) -> UpdateState:
        """The same with another number of considered errors; what the ones before did is forgotten."""
        p, m = self.theta.size, self.levels.shape[1]
        other = UpdateState(p, m, self.progress[LENGTH], self.memory[PERIOD], self.memory[COLOUR], c)
        other.rows[:, :, : p + 1] = self.rows[:, :, : p + 1]
        for name in ("theta", "P", "levels", "total", "starts", "known", "progress"):
            getattr(other, name)[:] = getattr(self, name)
        return other

    def __deepcopy__(self, memo: dict[int, Any]) -> UpdateState:
        other = object.__new__(UpdateState)
        other.__setstate__(self.__getstate__())
        return other

    def __getstate__(self) -> FloatArray:
        return self.memory.copy()

    def __setstate__(self, memory: FloatArray) -> None:
        self.memory = memory
        self._look()


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def parts(memory: FloatArray) -> tuple[FloatArray, ...]:
    """Views of the array, as the attributes of :class:`UpdateState`, and room for 2 p + c + 2 m values at the end."""
    p, m, c, levels = int(memory[0]), int(memory[1]), int(memory[2]), int(memory[3])
    a = _SIZES
    theta = memory[a : a + p]
    a += p
    P = memory[a : a + p * p].reshape((p, p))
    a += p * p
    S = memory[a : a + p * c].reshape((p, c))
    a += p * c
    rows = memory[a : a + m * p * (p + 1 + c)].reshape((m, p, p + 1 + c))
    a += m * p * (p + 1 + c)
    spreads = memory[a : a + 3 * m].reshape((3, m))
    a += 3 * m
    total = memory[a : a + m * (p + 2)].reshape((m, p + 2))
    a += m * (p + 2)
    starts = memory[a : a + levels * m * (p + 2)].reshape((levels, m, p + 2))
    a += levels * m * (p + 2)
    known = memory[a : a + levels * p * (p + 1)].reshape((levels, p, p + 1))
    a += levels * p * (p + 1)
    progress = memory[a : a + 2 * levels].reshape((2, levels))
    return theta, P, S, rows, spreads, total, starts, known, progress, memory[a + 2 * levels :]
