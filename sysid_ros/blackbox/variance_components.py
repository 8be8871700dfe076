"""Variance components: how large each of several random parts of a signal is, by restricted maximum likelihood (REML)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from sysid_ros.sample import FloatArray

_STEPS = 60
_SETTLED = 0.02
"""Growth of the log-likelihood in a step below which no component that matters still moves: a hundredth of what tells two models
from each other (2)."""
_CAREFUL, _BOLD = 0.5, 2.0
"""Powers of the ratio of what is explained to what is expected, by which a size grows: the square root never makes the data less
likely, larger ones are taken as long as they do not."""
_FIRST = 8
"""Steps after which a component on its way to zero is small enough to be told from one that grows."""
NOTHING = 1e-4
"""Part of the power below which a component is zero: a hundredth of the amplitude."""
_LIFT = 1e-6
"""Part of the power that is added to all rows as white noise, a thousandth of the amplitude, so that the covariance has an
inverse where nothing is noise."""
_ROUNDING = 10.0 * float(np.finfo(float).eps)
"""Of a covariance over its trace: that of a sum of some ten parts."""


@dataclass(frozen=True, eq=False)
class VarianceComponents:
    """``y = F b + sum_k e_k`` with ``e_k ~ N(0, s_k K_k)``, b free.

    H. D. Patterson, R. Thompson (1971), Recovery of inter-block information when block sizes are unequal, Biometrika 58. The
    steps are those of H. Zhou, L. Hu, J. Zhou, K. Lange (2019), MM algorithms for variance components models, J. Comput. Graph.
    Stat. 28, made longer as long as they lead up.

    Attributes:
        sizes: s, shape (k,); 0 for parts that the data have no use for. kernels: K, shape (n, n) each, of diagonals of about 1.
        P: ``V^-1 - V^-1 F (F' V^-1 F)^-1 F' V^-1``, shape (n, n). weights: P y, shape (n,). log_likelihood: restricted, less a
            constant.
    """

    sizes: FloatArray
    kernels: tuple[FloatArray, ...]
    P: FloatArray
    weights: FloatArray
    log_likelihood: float

    @classmethod
    def of(cls, y: FloatArray, F: FloatArray, kernels: Sequence[FloatArray], sizes: FloatArray) -> VarianceComponents:
        """With sizes that are known."""
        used = np.flatnonzero(sizes).tolist()
        return cls(sizes, tuple(kernels), *_inverse(y, F, [kernels[k] for k in used], sizes[used]))

    @classmethod
    def fitted(
        cls, y: FloatArray, F: FloatArray, kernels: Sequence[FloatArray], start: FloatArray | None = None
    ) -> VarianceComponents:
        """Of a signal of mean square about 1, shape (n,).

        Args:
            F: shape (n, c), full rank. start: sizes to begin with; 0 stays 0. None: all the same.
        """
        sizes = np.full(len(kernels), 1.0 / len(kernels)) if start is None else start.copy()
        last, power = -np.inf, _CAREFUL
        before = ratio = sizes
        for step in range(_STEPS):
            used = np.flatnonzero(sizes).tolist()
            P, weights, likelihood = _inverse(y, F, [kernels[k] for k in used], sizes[used])
            if step == _STEPS - 1:
                break
            if likelihood < last and power > _CAREFUL:
                # too far: the careful step from there never makes it less likely
                power, sizes = _CAREFUL, before * ratio**_CAREFUL
                continue
            if step > _FIRST and likelihood - last < _SETTLED:
                break
            last, before = likelihood, sizes
            ratio, least = np.zeros(len(sizes)), _ROUNDING * len(y) * float(np.trace(P))
            for k in used:
                explained, expected = float(weights @ kernels[k] @ weights), float(np.sum(kernels[k] * P))
                # a part that is a sum of the columns of F has any size, and shows none
                ratio[k] = max(explained, 0.0) / expected if expected > least else 0.0
            sizes = before * ratio**power
            if step >= _FIRST:
                sizes = np.where((sizes < NOTHING) & (ratio < 1.0), 0.0, sizes)
            power = min(1.5 * power, _BOLD)
        return cls(sizes, tuple(kernels), P, weights, likelihood)

    def gained_by(self, K: FloatArray) -> float:
        """About how much one part more would add to the log-likelihood: its score, squared, over twice its information."""
        score = 0.5 * (float(self.weights @ (K @ self.weights)) - float(np.sum(K * self.P)))
        PK = self.P @ K
        return max(score, 0.0) ** 2 / max(float(np.sum(PK * PK.T)), 1e-300)

    def covariance(self, parts: Sequence[int]) -> FloatArray:
        """Prior covariance of a sum of parts, shape (n, n)."""
        out = np.zeros_like(self.P)
        for k in parts:
            if self.sizes[k] > 0.0:
                out += self.sizes[k] * self.kernels[k]
        return out

    def information(self, used: Sequence[int]) -> FloatArray:
        """Average information of some sizes (A. R. Gilmour, R. Thompson, B. R. Cullis 1995), shape (u, u)."""
        moved = np.column_stack([self.kernels[k] @ self.weights for k in used])
        return np.asarray(0.5 * moved.T @ self.P @ moved)

    def power(self, parts: Sequence[int], rows: NDArray[np.bool_]) -> tuple[FloatArray, float]:
        """Expected square at some rows (bool, shape (n,)) of what a sum of parts was in these data, shape (r,), and the standard
        deviation of its mean.

        The sum is normal given the data, about ``E P y`` with covariance ``E - E P E``, E its prior covariance; that the sizes
        are estimates adds their own variance, to first order.
        """
        E, count = self.covariance(parts), max(int(np.sum(rows)), 1)
        A = (E @ self.P)[rows]
        mean = (E @ self.weights)[rows]
        C = E[np.ix_(rows, rows)] - A @ E[:, rows]
        power = mean**2 + np.diag(C)
        spread = max(2.0 * float(np.sum(C**2)) + 4.0 * float(mean @ C @ mean), 0.0) / count**2
        used = np.flatnonzero(self.sizes).tolist()
        if not used:
            return power, float(np.sqrt(spread))
        rest = np.eye(len(E))[rows] - A
        inner = {True: rest.T @ rest, False: A.T @ A}
        slope = np.empty(len(used))
        for u, k in enumerate(used):
            own = k in parts
            moved = (rest if own else -A) @ (self.kernels[k] @ self.weights)
            slope[u] = (2.0 * float(mean @ moved) + float(np.sum(inner[own] * self.kernels[k]))) / count
        of_sizes = float(slope @ linalg.pinvh(self.information(used)) @ slope)
        return power, float(np.sqrt(spread + max(of_sizes, 0.0)))


def _inverse(
    y: FloatArray, F: FloatArray, kernels: Sequence[FloatArray], sizes: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """P, P y and the restricted log-likelihood."""
    V = np.zeros((len(y), len(y)))
    for s, K in zip(sizes, kernels, strict=True):
        V += s * K
    # large sizes of parts of low rank leave rounding errors of their own size
    V[np.diag_indices(len(y))] += _LIFT + _ROUNDING * float(np.trace(V))
    root = linalg.cholesky(V, lower=True, check_finite=False)
    inverse, _ = linalg.lapack.dpotri(root, lower=1)
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
    G = inverse @ F
    inner = F.T @ G
    P = inverse - G @ np.linalg.solve(inner, G.T)
    weights = P @ y
    size = float(np.sum(np.log(np.diag(root)))) + 0.5 * float(np.linalg.slogdet(inner)[1])
    return P, weights, -size - 0.5 * float(y @ weights)
