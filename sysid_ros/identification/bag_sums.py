"""BagSums: all that least squares needs to know of some recordings, whatever their length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.identification.rows import BagRows
from sysid_ros.sample import FloatArray

_CHUNK = 4096


@dataclass(frozen=True, slots=True)
class BagSums:
    """Sums over the rows of moving joints, a bag and a joint each: B bags, n joints, p parameters.

    Attributes:
        normal: Y' Y, shape (B, n, p, p). score: Y' y, shape (B, n, p). power: y' y, shape (B, n). count: rows, shape (B, n).
    """

    normal: FloatArray
    score: FloatArray
    power: FloatArray
    count: FloatArray

    @classmethod
    def of(cls, bags: Sequence[BagRows], weights: Sequence[FloatArray] | None = None) -> BagSums:
        """Sum up rows, in pieces.

        Args:
            weights: of each row of each bag, shape (N, n); by default 1 where the joint moves, else 0.
        """
        n, p = bags[0].y.shape[1], bags[0].Y.shape[2]
        shape = (len(bags), n)
        normal, score, power, count = np.zeros((*shape, p, p)), np.zeros((*shape, p)), np.zeros(shape), np.zeros(shape)
        for b, bag in enumerate(bags):
            weight = bag.moving.astype(float) if weights is None else weights[b]
            for first in range(0, len(bag.t), _CHUNK):
                rows = slice(first, first + _CHUNK)
                for j in range(n):
                    w = weight[rows, j]
                    used = w > 0.0
                    Y, y, w = bag.Y[rows, j][used], bag.y[rows, j][used], w[used]
                    # links that a joint does not move have no columns in its rows
                    here = np.flatnonzero(Y.any(axis=0))
                    Y = np.ascontiguousarray(Y[:, here])
                    weighted = Y.T * w
                    normal[b, j][np.ix_(here, here)] += weighted @ Y
                    score[b, j, here] += weighted @ y
                    power[b, j] += float(w * y @ y)
                    count[b, j] += float(w.sum())
        return cls(normal, score, power, count)

    def only(self, bags: Sequence[int]) -> BagSums:
        """Those of some of the bags."""
        which = list(bags)
        return BagSums(self.normal[which], self.score[which], self.power[which], self.count[which])

    def columns(self, which: NDArray[np.intp]) -> BagSums:
        """Those of some of the parameters."""
        return BagSums(self.normal[:, :, which][:, :, :, which], self.score[:, :, which], self.power, self.count)

    def information(self, weight: FloatArray) -> FloatArray:
        """``sum w Y' Y``, shape (p, p), for weights of bags and joints of shape (B, n)."""
        return np.asarray(np.einsum("bj,bjac->ac", weight, self.normal))

    def right_side(self, weight: FloatArray) -> FloatArray:
        """``sum w Y' y``, shape (p,)."""
        return np.asarray(np.einsum("bj,bja->a", weight, self.score))

    def squares(self, theta: FloatArray) -> FloatArray:
        """Sum of the squared residuals of a bag and a joint, shape (B, n) [(N m)^2]."""
        quadratic = np.einsum("bjac,a,c->bj", self.normal, theta, theta)
        return np.asarray(np.maximum(self.power - 2.0 * self.score @ theta + quadratic, 0.0))
