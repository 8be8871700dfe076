"""UpdateState: all that one compiled update reads and changes, in one array, so that a call takes one argument for it."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numba import njit

from sysid_ros.estimators.kernels import room_of_update
from sysid_ros.sample import FloatArray

SPREAD, NOISE, FLOOR = range(3)
"""Rows of ``levels``, shape (3, m): total variance of the innovations, variance that weighs a row, and the least of both."""
FILLED, LENGTH = range(2)
"""Rows of ``progress``, shape (2, number of lengths): updates in each block so far, and in a full one."""
PERIOD, COLOUR, WAITING = 4, 5, 6
"""Where in ``memory`` stand the time between updates [s], for how many rows what is added to the noise of one stays, and how many
updates wait to be added to the sums."""
_SIZES: Final = 7
"""Values at the beginning of ``memory``: p, m, c, the number of lengths, and these."""
MOST_WAITING: Final = 10
"""Updates that wait at most: the sums are larger than the fastest cache, and are so fetched once for all of these."""


class UpdateState:
    """What :func:`.variable_update.take_in` works on: p parameters, m rows, c considered errors, l lengths of blocks.

    Args:
        p, m, c: sizes. lengths: rows a block, a level, shape (l,). period, colour: see :data:`PERIOD`.

    Attributes:
        memory: everything, shape (k,); the others are views of it.
        theta, P, S: estimate (p,), covariance (p, p), derivative by the considered errors (p, c). variances: diagonal of P.
        levels: shape (3, m), see :data:`SPREAD`.
        total, starts, known, progress: see :func:`.variable_update.add_to_blocks` and :data:`FILLED`.
    """

    def __init__(self, p: int, m: int, lengths: FloatArray, period: float, colour: float, c: int = 0) -> None:
        levels = lengths.size
        beside = 3 * m + m * (p + 2) * (levels + 1) + levels * p * (p + 1) + 2 * levels + 2 * m + room_of_update(p, c)
        beside += MOST_WAITING * m * (p + 2 + c)
        self.memory = np.zeros(_SIZES + p * (1 + p + c) + m * p * (p + 1 + c) + beside)
        self.memory[:_SIZES] = p, m, c, levels, period, colour, 0.0
        self._look()
        self.progress[LENGTH] = lengths

    def _look(self) -> None:
        (
            self.theta, self.P, self.S, self._rows, self.levels, self.total, self.starts, self.known, self.progress, *_
        ) = parts(self.memory)  # fmt: skip
        self.variances = self.P.diagonal()

    @property
    def rows(self) -> FloatArray:
        """Sums of each row, shape (m, p, p + 1 + c), see :class:`.RowSums`, with all that have waited."""
        add_waiting(self.memory)
        sums: FloatArray = self._rows
        return sums

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
    """Views of the array, as the attributes of :class:`UpdateState`; then ``[Y | tau | Z | weight]`` of the updates that wait,
    shape (10, m, p + 2 + c), and room for 2 m values and those of :func:`.room_of_update`."""
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
    a += 2 * levels
    waiting = memory[a : a + MOST_WAITING * m * (p + 2 + c)].reshape((MOST_WAITING, m, p + 2 + c))
    return theta, P, S, rows, spreads, total, starts, known, progress, waiting, memory[a + waiting.size :]


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def add_waiting(memory: FloatArray) -> None:
    """Add the updates that wait to the sums of each row: ``rows[i] += w_i y_i [y_i' | tau_i | z_i']``."""
    _, _, _, rows, _, _, _, _, _, waiting, _ = parts(memory)
    m, p, width = rows.shape
    for i in range(m):
        for n in range(int(memory[WAITING])):
            x = waiting[n, i]
            for a in range(p):
                y = x[width] * x[a]
                if y != 0.0:
                    for k in range(width):
                        rows[i, a, k] += y * x[k]
    memory[WAITING] = 0.0
