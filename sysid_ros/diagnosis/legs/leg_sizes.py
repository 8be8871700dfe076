"""Sizes: the likelihood of rows with a covariance of parts whose sizes are not known, at the likeliest sizes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy import linalg, optimize, special

from sysid_ros.diagnosis.whose.robot_likelihood import LEAVES
from sysid_ros.sample import FloatArray

_USUAL, _SPREAD = np.log([0.05, np.exp(LEAVES), 0.3]), np.log(3.0)
"""Logarithms before any data of noise s, discrepancy kappa and how inexact each thing is: means, and their standard deviation."""
_STARTS = [np.log(x) for x in product((0.05, 0.1, 0.3), (0.005, 0.05, 0.5), (0.05, 0.3, 2.0))]
"""Where a search may start: the same for each thing that is inexact."""
_STEPS, _FEW = 30, 6
"""Most steps of a search, and of a rough one."""
_LEAST = 1e-6
"""Part of its variance before the rows that a coefficient has after them at least."""


class Sizes:
    """Likelihood of rows (N,) with covariance ``K = fixed + sum_i exp(2 x_i) P_i``, by x, the logarithms of sizes.

    Args:
        rows: shape (N,). fixed, parts: P_i, shape (N, N) each, of noise, discrepancy, and of each thing that is inexact.
        ranges: of each x_i. scale: added to each log-density. rubs: columns of dry friction, (N, n), and which part they make.
    """

    def __init__(
        self,
        rows: FloatArray,
        fixed: FloatArray,
        parts: Sequence[FloatArray],
        ranges: Sequence[FloatArray],
        scale: float,
        rubs: tuple[FloatArray, int],
    ) -> None:
        self.rows, self.fixed, self.parts, self.scale, self._rubs = rows, fixed, parts, scale, rubs
        self._ranges, self._usual = ranges, self._all(_USUAL)

    def _all(self, x: FloatArray) -> FloatArray:
        """Noise, discrepancy, and the third for each thing that is inexact."""
        return np.concatenate([x[:2], np.full(len(self.parts) - 2, x[2])])

    def _root(self, x: FloatArray) -> FloatArray | None:
        """The Cholesky factor of K; None where rounding leaves none."""
        K = self.fixed + sum(float(np.exp(2.0 * z)) * P for z, P in zip(x, self.parts, strict=True))
        root, failed = linalg.lapack.dpotrf(K, lower=1)
        return None if failed else np.asarray(root)

    def densities(self, x: FloatArray) -> FloatArray:
        """Log-density of each row given those before it, and its share of that of x before any data, shape (N,)."""
        root = self._root(x)
        if root is None:
            return np.full(len(self.rows), -np.inf)
        white = linalg.solve_triangular(root, self.rows, lower=True, check_finite=False)
        rows = 0.5 * white**2 + np.log(np.diag(root)) + 0.5 * np.log(2.0 * np.pi)
        return np.asarray(self.scale - rows - 0.5 * np.sum(((x - self._usual) / _SPREAD) ** 2) / len(rows))

    def loss(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Negative log-density of all rows, with its slope."""
        root = self._root(x)
        if root is None:
            return np.inf, np.zeros(len(x))
        alpha = linalg.cho_solve((root, True), self.rows, check_finite=False)
        lower = np.tril(linalg.lapack.dpotri(root, lower=1)[0])
        inverse = lower + np.tril(lower, -1).T
        value = 0.5 * float(self.rows @ alpha) + float(np.log(np.diag(root)).sum())
        slope = [np.exp(2.0 * z) * (np.vdot(inverse, P) - alpha @ P @ alpha) for z, P in zip(x, self.parts, strict=True)]
        unusual = (x - self._usual) / _SPREAD
        return value + 0.5 * float(unusual @ unusual), np.array(slope) + unusual / _SPREAD

    def likeliest(self, few: bool) -> FloatArray:
        """The densities at the likeliest sizes; ``few``: after a few steps towards them."""
        start = max(map(self._all, _STARTS), key=lambda x: float(np.sum(self.densities(x))))
        options = {"maxiter": _FEW if few else _STEPS, "ftol": 1e-7}
        found = optimize.minimize(self.loss, start, jac=True, method="L-BFGS-B", bounds=self._ranges, options=options)
        return self.densities(found.x) + self._takes(found.x) / len(self.rows)

    def _takes(self, x: FloatArray) -> float:
        """What it says for a hypothesis that friction takes power: of each coefficient the probability after the rows that it is
        positive, over that before them, which is a half; the logarithm of their product."""
        root, (columns, part) = self._root(x), self._rubs
        if root is None:
            return 0.0
        both = np.column_stack([float(np.exp(x[part])) * columns, self.rows])
        white = linalg.solve_triangular(root, both, lower=True, check_finite=False)
        left = np.maximum(1.0 - np.sum(white[:, :-1] ** 2, axis=0), _LEAST)
        return float(np.sum(special.log_ndtr(white[:, :-1].T @ white[:, -1] / np.sqrt(left)) + np.log(2.0)))
