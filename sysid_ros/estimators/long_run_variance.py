"""Noise of the torques, learned from residuals that are not white, and from innovations over blocks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from sysid_ros.estimators.update_state import FILLED, UpdateState
from sysid_ros.sample import FloatArray

_LEAST_COUNT = 1e-3
"""Blocks that a row counts as at least; so few of all rows tell nothing."""
_MOST_LEVERAGE = 3.0
"""A block that the prior or a fresh jump makes more uncertain than this says little of the noise."""


class LongRunVariance:
    """Variance of the mean of a coloured residual, a row: its spectral density at zero frequency over the update period.

    Filtered residuals are not white, so their plain variance makes a covariance that is far too small. Batch means (Flegal,
    Jones 2010) over blocks of growing length see the colour: the block is lengthened as long as that raises the variance
    significantly.

    Until enough blocks are full the variance is a cautious multiple of the floor. A row next to whose noise much more may hide
    tells little of it: its blocks count as the part of their variance that is noise. A row of which too little was seen is taken
    to be above its floor as the others are.

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
        self._count, self._seen = np.zeros((len(self.BLOCKS), m)), np.zeros(len(self.BLOCKS))
        self._parts = np.zeros((len(self.BLOCKS), m))
        self.variance = self.CAUTION * floor
        self.known = False

    @property
    def fewest_updates(self) -> int:
        """Residuals that it takes to know the noise."""
        return int(self.FEWEST * self.lengths[0])

    def add(self, residual: FloatArray, part: FloatArray) -> bool:
        """Take in the residual after an update, and the part of its variance that is noise, shape (m,) each; True where the
        noise is known otherwise than before."""
        before, sums = self._seen[0], (self._sums, self._parts, self._filled)
        _accumulate(residual, part, *sums, self.lengths, self._power, self._count, self._seen, self._keep)
        return self._seen[0] != before and self._estimate()

    def add_all(self, residuals: FloatArray) -> None:
        """Take in residuals that follow one another and are nothing but noise, shape (N, m)."""
        sums = (self._sums, self._parts, self._filled)
        _accumulate_all(residuals, (*sums, self.lengths, self._power, self._count, self._seen, self._keep))
        self._estimate()

    def add_block(self, level: int, power: FloatArray, part: FloatArray) -> bool:
        """Take in what a block of a level says of the noise, and the part of its variance that is noise, shape (m,) each; True
        where the noise is known otherwise than before."""
        fade = self._keep ** self.lengths[level]
        self._power[level] = fade * self._power[level] + part * power
        self._count[level] = fade * self._count[level] + part
        self._seen[level] = fade * self._seen[level] + 1.0
        return level == 0 and self._estimate()

    def _estimate(self) -> bool:
        self.known = bool(self._seen[0] > self.FEWEST - 0.5)
        if not self.known:
            return False
        counts = np.maximum(self._count, _LEAST_COUNT)
        means = self._power / counts
        fewest = self.FEWEST - 0.5
        chosen = means[0] * _small_sample(np.maximum(counts[0], fewest))
        for level in range(1, len(self.BLOCKS)):
            count, longer = counts[level], means[level]
            if self._seen[level] < self.FEWEST_LONGER - 0.5:
                break
            grown = 2.0 * longer - means[level - 1]
            chosen = np.where(longer > chosen * (1.0 + 1.5 * np.sqrt(2.0 / count)), grown * _small_sample(count), chosen)
        own = np.maximum(chosen, self.floor)
        told = np.minimum(counts[0] / fewest, 1.0)  # the rest of so many blocks is supposed
        seen = float(told.sum())
        above = np.exp(told @ np.log(own / self.floor) / seen) if seen > _LEAST_COUNT else self.CAUTION
        self.variance = told * own + (1.0 - told) * self.floor * above
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
        self._sums[:] = self._parts[:] = 0.0
        self._filled[:] = 0.0


class BlockInnovations:
    """``u = sum_k (tau_k - Y_k theta_0)`` over a block of N rows, theta_0 from before it, has the variance
    ``N r + Ysum P_0 Ysum'``, so that ``u^2 / N / (1 + Ysum P_0 Ysum' / (N r))`` has the mean r.

    Residuals of a fit that follows slow noise are smaller than the noise, the more so the longer the block; innovations over a
    whole block are not (recursive residuals: Brown, Durbin, Evans 1975).

    Args:
        state: what :func:`variable_update.add_to_blocks` adds to.
    """

    def __init__(self, state: UpdateState) -> None:
        self.state = state

    def interrupt(self) -> None:
        """Drop the blocks in progress."""
        self.state.progress[FILLED] = 0.0

    def pop_full(self, variance: FloatArray) -> list[tuple[int, FloatArray, FloatArray]]:
        """The level of each block that is full, its estimate of the noise, and the part of its variance that is noise, shape
        (m,) each; they begin anew.

        Args:
            variance: noise of the rows as it is known, shape (m,).
        """
        now = self.state
        filled, lengths = now.progress
        full = []
        for level in np.flatnonzero(filled >= lengths):
            filled[level] = 0.0
            sums, known = now.total - now.starts[level], now.known[level]
            Ysum, P = sums[:, :-2], known[:, :-1]
            innovation = sums[:, -2] - Ysum @ known[:, -1]
            leverage = ((Ysum @ P) * Ysum).sum(axis=1) / (lengths[level] * variance)
            if float(leverage.max()) < _MOST_LEVERAGE:
                full.append((int(level), innovation**2 / lengths[level] / (1.0 + leverage), sums[:, -1] / lengths[level]))
        return full


def _small_sample(count: FloatArray) -> FloatArray:
    """Widens the variance as Student's t does the interval."""
    return 1.0 + 4.0 / count


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _accumulate(
    residual: FloatArray,
    part: FloatArray,
    sums: FloatArray,
    parts: FloatArray,
    filled: FloatArray,
    lengths: FloatArray,
    power: FloatArray,
    count: FloatArray,
    seen: FloatArray,
    keep: float,
) -> None:
    """Batch means at several block lengths: adds a residual (m,) to ``sums`` (levels, m); a block that is full adds its squared
    sum over its length, times the mean ``part`` of it, to ``power`` (levels, m), that part to ``count`` (levels, m) and one to
    ``seen`` (levels,), all fading by ``keep`` a sample of the block."""
    for level in range(lengths.size):
        for i in range(residual.size):
            sums[level, i] += residual[i]
            parts[level, i] += part[i]
        filled[level] += 1.0
        if filled[level] >= lengths[level]:
            fade = keep ** lengths[level]
            seen[level] = fade * seen[level] + 1.0
            for i in range(residual.size):
                told = parts[level, i] / lengths[level]
                power[level, i] = fade * power[level, i] + told * sums[level, i] * sums[level, i] / lengths[level]
                count[level, i] = fade * count[level, i] + told
                sums[level, i] = parts[level, i] = 0.0
            filled[level] = 0.0


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _accumulate_all(residuals: FloatArray, state: tuple[Any, ...]) -> None:
    """:func:`_accumulate` of each row of (N, m), all of it noise; ``state``: what it takes beside the row."""
    part = np.ones(residuals.shape[1])
    for k in range(residuals.shape[0]):
        _accumulate(residuals[k], part, *state)
