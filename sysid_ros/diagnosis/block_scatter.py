"""Does a fit scatter more from one stretch of time to the next than its noise explains?

The score of a parameter is a sum over time, ``g = sum_b g_b``, zero at the fit. If the noise is what the weights say, flipping
the signs of whole blocks at random changes nothing but the signs, and the mean of ``(V g)_k^2`` over all such flips,
``(V sum_b g_b g_b' V)_kk``, is the variance V_kk. Where it is larger, the rows within a block are dependent in a way that the
weights don't know: a model that is wrong for a while, noise that comes and goes or that joints share. (Block sign flips in
expectation are the covariance of White 1980 with clusters, Liang, Zeger 1986.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from sysid_ros.diagnosis.band import Band
from sysid_ros.sample import FloatArray

_BLOCK = 1.5
"""Length of a block [s]: longer than what whitening leaves of a correlation."""
_SURELY = 2.0
"""Standard deviations by which a ratio must exceed 1 before it counts."""


class BlockScatter:
    """Scores of the parameters of a fit, block by block.

    Args:
        band: of the rows. count: number of parameters m.
    """

    def __init__(self, band: Band, count: int) -> None:
        self._band = band
        lengths = [max(1, round((where.stop - where.start) * band.motions[i].period / _BLOCK)) for i, where, _ in band.slices]
        self._first = np.concatenate([[0], np.cumsum(lengths)])
        self._scores = np.zeros((int(self._first[-1]), count))

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
            parts = np.array_split(x * r[:, None], self._first[s + 1] - self._first[s])
            for b, part in enumerate(parts):
                self._scores[self._first[s] + b, index] += part.sum(axis=0)

    def ratios(self, inverse: FloatArray) -> FloatArray:
        """Variance with the scatter over the variance without, at least 1, shape (m,); 1 also where the excess may be chance.

        Args:
            inverse: of the information, shape (m, m).
        """
        return scatter_ratios(self._scores, inverse)


def scatter_ratios(scores: FloatArray, inverse: FloatArray) -> FloatArray:
    """As :meth:`BlockScatter.ratios` gives it, for scores of any blocks, shape (blocks, m)."""
    blocks = len(scores)
    moved = scores @ inverse
    variance = np.maximum(np.diag(inverse), 1e-300)
    ratio = np.sum(moved**2, axis=0) / variance * blocks / max(blocks - 1, 1)
    return np.where(ratio > 1.0 + _SURELY * np.sqrt(2.0 / blocks), ratio, 1.0)
