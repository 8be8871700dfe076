"""How much more parameters scatter over time than the noise explains: the scores of a fit, block by block."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from sysid_ros.diagnosis.band import Band
from sysid_ros.estimators.symmetric import inverse_of
from sysid_ros.sample import FloatArray

_BLOCK = 1.5
"""Length of a block [s]: longer than what whitening leaves of a correlation."""
_MOST = 60
"""More blocks tell no more, and cost time."""
_KNOWN = 6.0
"""Blocks that are worth as much as what is known of such a ratio before any data: its mean is 1.5 then. Of the parameters of 16
robots of the level ``real`` 1.4 was the median and 1.9 the mean."""
_ALONE = 1e-6
"""Part of what is known of a parameter that the other blocks must tell: less is rounding."""


class BlockScatter:
    """Scores of the parameters of a fit, block by block.

    Args:
        band: of the rows. count: number of parameters m.
    """

    def __init__(self, band: Band, count: int) -> None:
        self._band = band
        length = max(_BLOCK, band.seconds / _MOST)
        lengths = [max(1, round((where.stop - where.start) * band.motions[i].period / length)) for i, where, _ in band.slices]
        self._first = np.concatenate([[0], np.cumsum(lengths)])
        self._scores = np.zeros((int(self._first[-1]), count))
        self._information = np.zeros((int(self._first[-1]), count, count))

    def add(self, columns: FloatArray, residual: FloatArray, index: NDArray[np.intp]) -> None:
        """Count in one joint.

        Args:
            columns: whitened, shape (K, p). residual: whitened, shape (K,). index: which parameters the columns belong to.
        """
        begin = 0
        for s, (_, _, count) in enumerate(self._band.slices):
            rows = slice(begin, begin + count)
            begin += count
            x, r = (fft.idct(part, axis=0, norm="ortho") for part in (columns[rows], residual[rows]))
            parts = np.array_split(np.arange(count), self._first[s + 1] - self._first[s])
            for b, part in enumerate(parts, int(self._first[s])):
                self._scores[b, index] += x[part].T @ r[part]
                self._information[b][np.ix_(index, index)] += x[part].T @ x[part]

    def ratios(self, information: FloatArray) -> FloatArray:
        """Variance with the scatter over the variance without, at least 1, shape (m,).

        Args:
            information: of all rows and before any data, shape (m, m).
        """
        return scatter_ratios(self._scores, self._information, information)


def scatter_ratios(scores: FloatArray, each: FloatArray, information: FloatArray) -> FloatArray:
    """As :meth:`BlockScatter.ratios` gives it, for scores of any blocks, shape (blocks, m).

    Each block counts as much as it tells of a parameter. A ratio is known from so many blocks as a variance is from so many
    values: the mean of its scaled inverse chi-squared distribution makes the parameter's variance that of Student's. What is
    known of a parameter before any data does not scatter.

    Args:
        each: information of each block, shape (blocks, m, m). information: as :meth:`BlockScatter.ratios` has it.
    """
    whole = inverse_of(information)
    variance = np.maximum(np.diag(whole), 1e-300)
    without = inverse_of(information - each)
    moved = np.einsum("bij,bj->bi", without, scores) ** 2
    told = np.maximum(np.einsum("ij,bjk,ki->bi", whole, each, whole, optimize=True), 0.0) / variance
    # (M - G)^-1 - M^-1 is M^-1 G M^-1 at least, but for rounding
    expected = np.maximum(np.diagonal(without, axis1=1, axis2=2) - variance, told * variance)
    total = np.maximum(told.sum(axis=0), 1e-300)
    told = np.where(_ALONE * expected < variance, told, 0.0)  # without it nothing is left that it could be compared with
    blocks = told.sum(axis=0) ** 2 / np.maximum(np.sum(told**2, axis=0), 1e-300)
    ratio = np.sum(told / np.maximum(expected, 1e-300) * moved, axis=0) / np.maximum(told.sum(axis=0), 1e-300)
    more = np.maximum((_KNOWN + blocks * ratio) / (_KNOWN + blocks - 2.0) - 1.0, 0.0)
    return np.asarray(1.0 + np.minimum(total, 1.0) * more)
