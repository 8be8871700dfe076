"""Noise of the torques, learned from residuals that are not white, and from innovations over blocks."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.estimators import variable_update
from sysid_ros.sample import FloatArray

_MOST_LEVERAGE = 3.0
"""A block that the prior or a fresh jump makes more uncertain than this says little of the noise."""


class LongRunVariance:
    """Variance of the mean of a coloured residual, a row: its spectral density at zero frequency over the update period.

    Filtered residuals are not white, so their plain variance makes a covariance that is far too small. Batch means (Flegal,
    Jones 2010) over blocks of growing length see the colour: the block is lengthened as long as that raises the variance
    significantly.

    Until enough blocks are full the variance is a cautious multiple of the floor.

    Args:
        m: number of rows.
        period: time between updates [s].
        floor: variance below which the estimate never falls, shape (m,), as the variance of one update's row.
        memory: time constant of fading [s].

    Attributes:
        known: True once enough blocks were seen for the estimate to rest on data.
        variance: of each row, shape (m,).
    """

    BLOCKS = (0.25, 0.5, 1.0, 2.0, 4.0)
    FEWEST = 8
    FEWEST_LONGER = 4
    CAUTION = 100.0

    def __init__(self, m: int, period: float, floor: FloatArray, memory: float = 120.0) -> None:
        self.period = period
        self.floor = floor
        self.lengths = np.array([max(round(b / period), 1) for b in self.BLOCKS], dtype=float)
        self._keep = float(np.exp(-period / memory))
        self._sums = np.zeros((len(self.BLOCKS), m))
        self._filled = np.zeros(len(self.BLOCKS))
        self._power = np.zeros((len(self.BLOCKS), m))
        self._count = np.zeros(len(self.BLOCKS))
        self.variance = self.CAUTION * floor
        self.known = False

    @property
    def fewest_updates(self) -> int:
        """Residuals that it takes to know the noise."""
        return int(self.FEWEST * self.lengths[0])

    def add(self, residual: FloatArray) -> bool:
        """Take in the residual after an update, shape (m,); True where the noise is known otherwise than before."""
        before = self._count[0]
        _accumulate(residual, self._sums, self._filled, self.lengths, self._power, self._count, self._keep)
        return self._count[0] != before and self._estimate()

    def add_block(self, level: int, power: FloatArray) -> bool:
        """Take in what a block of a level says of the noise, shape (m,); True where the noise is known otherwise than before."""
        fade = self._keep ** self.lengths[level]
        self._power[level] = fade * self._power[level] + power
        self._count[level] = fade * self._count[level] + 1.0
        return level == 0 and self._estimate()

    def _estimate(self) -> bool:
        self.known = bool(self._count[0] > self.FEWEST - 0.5)
        if not self.known:
            return False
        chosen = self._power[0] / self._count[0] * _small_sample(self._count[0])
        for level in range(1, len(self.BLOCKS)):
            count = self._count[level]
            if count < self.FEWEST_LONGER - 0.5:
                break
            longer = self._power[level] / count
            grown = 2.0 * longer - self._power[level - 1] / self._count[level - 1]
            chosen = np.where(longer > chosen * (1.0 + 1.5 * np.sqrt(2.0 / count)), grown * _small_sample(count), chosen)
        self.variance = np.maximum(chosen, self.floor)
        return True

    def coloured(self, spread: FloatArray) -> FloatArray:
        """Long-run variance of the rows; while it is not known, as if what is left, of variance ``spread`` (m,), kept its value
        for a block, shape (m,)."""
        return self.variance if self.known else np.asarray(np.maximum(self.variance, spread * self.BLOCKS[0] / self.period))

    def widen(self, factor: float) -> None:
        """What was learned so far counts as ``factor`` times as much."""
        self._power *= factor
        self.variance = self.variance * factor

    def interrupt(self) -> None:
        """Drop the blocks in progress: the residuals to come do not follow the ones before."""
        self._sums[:] = 0.0
        self._filled[:] = 0.0


class BlockInnovations:
    """``u = sum_k (tau_k - Y_k theta_0)`` over a block of N rows, theta_0 from before it, has the variance
    ``N r + Ysum P_0 Ysum'``, so that ``u^2 / N / (1 + Ysum P_0 Ysum' / (N r))`` has the mean r.

    Residuals of a fit that follows slow noise are smaller than the noise, the more so the longer the block; innovations over a
    whole block are not (recursive residuals: Brown, Durbin, Evans 1975).

    Args:
        lengths: rows a block, a level, shape (levels,). m: rows of an update. p: parameters.

    Attributes:
        total, starts, known, progress: what :func:`variable_update.add_to_blocks` adds to.
    """

    def __init__(self, lengths: FloatArray, m: int, p: int) -> None:
        levels = len(lengths)
        self.progress = np.zeros((2, levels))
        self.progress[variable_update.LENGTH] = lengths
        self.total = np.zeros((m, p + 1))
        self.starts = np.zeros((levels, m, p + 1))
        self.known = np.zeros((levels, p, p + 1))

    def interrupt(self) -> None:
        """Drop the blocks in progress."""
        self.progress[variable_update.FILLED] = 0.0

    def pop_full(self, variance: FloatArray) -> list[tuple[int, FloatArray]]:
        """The level of each block that is full, and its estimate of the noise, shape (m,); they begin anew.

        Args:
            variance: noise of the rows as it is known, shape (m,).
        """
        filled, lengths = self.progress
        full = []
        for level in np.flatnonzero(filled >= lengths):
            filled[level] = 0.0
            sums, known = self.total - self.starts[level], self.known[level]
            Ysum, P = sums[:, :-1], known[:, :-1]
            innovation = sums[:, -1] - Ysum @ known[:, -1]
            leverage = ((Ysum @ P) * Ysum).sum(axis=1) / (lengths[level] * variance)
            if float(leverage.max()) < _MOST_LEVERAGE:
                full.append((int(level), innovation**2 / lengths[level] / (1.0 + leverage)))
        return full


def _small_sample(count: float) -> float:
    """Widens the variance as Student's t does the interval."""
    return 1.0 + 4.0 / count


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _accumulate(
    residual: FloatArray,
    sums: FloatArray,
    filled: FloatArray,
    lengths: FloatArray,
    power: FloatArray,
    count: FloatArray,
    keep: float,
) -> None:
    """Batch means at several block lengths: adds a residual (m,) to ``sums`` (levels, m); a block that is full adds its squared
    sum over its length to ``power`` (levels, m) and one to ``count`` (levels,), both fading by ``keep`` a sample of the block."""
    for level in range(lengths.size):
        for i in range(residual.size):
            sums[level, i] += residual[i]
        filled[level] += 1.0
        if filled[level] >= lengths[level]:
            fade = keep ** lengths[level]
            count[level] = fade * count[level] + 1.0
            for i in range(residual.size):
                power[level, i] = fade * power[level, i] + sums[level, i] * sums[level, i] / lengths[level]
                sums[level, i] = 0.0
            filled[level] = 0.0
