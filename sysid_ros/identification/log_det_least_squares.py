"""Least squares with a log-det term and bounds: a semidefinite program for Clarabel, and Newton's method to the last digit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.sample import FloatArray

UPPER = tuple((i, j) for i in range(4) for j in range(i, 4))
BASIS = np.zeros((10, 4, 4))
for _k, (_i, _j) in enumerate(UPPER):
    BASIS[_k, _i, _j] = BASIS[_k, _j, _i] = 1.0

_RIDGE = 1e-10
"""Added to the squared unknowns outside the matrices: decides combinations of them that no row shows."""

_CONVERGED = 1e-9
_ROUNDING = 1e-12
_STALLED = 1e-7
"""Parts of the cost: the promised gain under which rounding hides it, and under which a step that brings none is the last."""
_STEPS = 100

_PART_OF_BOUND = 1e-6
"""Clarabel is given the cost in units of this part of the cost at the identity, which brings its numbers near 1."""


def vector(matrix: FloatArray) -> FloatArray:
    """Upper triangle of a symmetric matrix (4, 4), shape (10,)."""
    return np.array([matrix[i, j] for i, j in UPPER])


def symmetric(upper: FloatArray) -> FloatArray:
    """Symmetric matrix (4, 4) from its upper triangle (10,)."""
    return np.asarray(np.einsum("k,kij->ij", upper, BASIS))


class LogDetLeastSquares:
    """``min |R x - z|^2 / 2 + w sum_k (tr X_k - log det X_k)`` over X_k positive definite and some of the others >= 0.

    Args:
        rows: R, shape (r, p), of any condition. target: z, shape (r,).
        starts: where each X_k of shape (4, 4) begins in x with the ten entries of its upper triangle; 1 is where w alone puts it.
        bounded: indices of unknowns outside the matrices that must not be negative.
    """

    def __init__(
        self, rows: FloatArray, target: FloatArray, starts: Sequence[int], bounded: np.ndarray[tuple[int], np.dtype[np.intp]]
    ) -> None:
        p = rows.shape[1]
        self._starts = tuple(starts)
        self._others = np.array([j for j in range(p) if not any(s <= j < s + 10 for s in starts)], dtype=np.intp)
        ridge = np.zeros((len(self._others), p))
        ridge[np.arange(len(self._others)), self._others] = _RIDGE**0.5
        self._rows = np.vstack([rows, ridge])
        self._target = np.concatenate([target, np.zeros(len(self._others))])
        self._lower = np.full(p, -np.inf)
        self._lower[bounded] = 0.0

    def at_identity(self) -> FloatArray:
        """x with every X_k = 1: least squares with bounds over the others, where the weight is infinite."""
        x = np.zeros(len(self._lower))
        for start in self._starts:
            x[start : start + 10] = vector(np.eye(4))
        if len(self._others):
            x[self._others] = _bounded_least_squares(
                self._rows[:, self._others], self._target - self._rows @ x, self._lower[self._others]
            )
        return x

    def solve(self, weight: float) -> tuple[FloatArray, float, str]:
        """Clarabel's point, from which Newton's method goes to the last digit.

        Where Clarabel fails, Newton's method follows the minimum from the identity by weights that fall. Rows that no
        positive definite matrices can satisfy, by very much more than the weight, leave the minimum so close to the border that
        even this may end early; with any weight w the squares are at most ``4 w`` a matrix above their least.

        Args:
            weight: positive and finite.

        Returns:
            x, shape (p,); the weight that it belongs to, infinite at worst; why it is not the one asked for.
        """
        x = self.at_identity()
        if not self._starts:
            return x, weight, ""
        rest = self._rows @ x - self._target
        bound = 0.5 * float(rest @ rest)
        start, words = self._by_clarabel(weight, max(weight, _PART_OF_BOUND * bound))
        if start is not None:
            found, steps = self._newton(start, weight)
            if steps is not None:
                return found, weight, ""
        reached, ratio = max(bound, weight), 2.0
        while True:
            following = max(weight, reached / ratio)
            found, steps = self._newton(x, following)
            if steps is not None:
                x, reached = found, following
                if reached == weight:
                    break
                ratio = max(2.0, min(1e4, ratio * (8.0 if steps < 3 else 1.0 if steps < 12 else 0.25)))
            elif ratio > 2.0:
                ratio = 2.0
            else:
                return x, reached, words
        return x, weight, ""

    def _by_clarabel(self, weight: float, scale: float) -> tuple[FloatArray | None, str]:
        """The least of cost / scale to a solver's usual 1e-8, or None and the solver's own word."""
        import warnings

        import cvxpy as cp  # takes half a second, and only identification needs it

        matrices = [cp.Variable((4, 4), symmetric=True) for _ in self._starts]
        rest = cp.Variable(max(len(self._others), 1))
        residual = cp.Variable(len(self._rows))
        # rows of unit length, and the residual as an unknown of its own: sizes from 1e-5 to 1e7 in one matrix are too much
        size = np.maximum(np.linalg.norm(self._rows, axis=1), 1e-12)
        rows, total = self._rows / size[:, None], -self._target / size
        for start, matrix in zip(self._starts, matrices, strict=True):
            total = total + rows[:, start : start + 10] @ cp.hstack([matrix[i, j] for i, j in UPPER])
        if len(self._others):
            total = total + rows[:, self._others] @ rest
        inside = np.flatnonzero(np.isfinite(self._lower[self._others]))
        log_det = sum(cp.trace(m) - cp.log_det(m) for m in matrices)
        problem = cp.Problem(
            cp.Minimize(weight / scale * log_det + 0.5 / scale * cp.sum_squares(residual)),
            [cp.multiply(1.0 / size, residual) == total, *([rest[inside] >= 0.0] if len(inside) else [])],
        )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # an inaccurate point is as good a start; what follows checks it
                problem.solve(solver=cp.CLARABEL)
        except cp.SolverError as error:
            return None, str(error)
        x = np.zeros(len(self._lower))
        if any(m.value is None for m in matrices):
            return None, f"Clarabel ends with '{problem.status}'"
        if len(self._others):
            x[self._others] = np.maximum(rest.value, self._lower[self._others])
        for start, matrix in zip(self._starts, matrices, strict=True):
            x[start : start + 10] = vector(matrix.value)
        if not all(_is_positive(symmetric(x[s : s + 10])) for s in self._starts):
            return None, f"Clarabel ends with '{problem.status}' at matrices that are not positive definite"
        return x, ""

    def _newton(self, x: FloatArray, weight: float) -> tuple[FloatArray, int | None]:
        """The point that Newton's method reaches from a point inside, and in how many steps; None where it is no minimum.

        With X = L L' and E = L^-1 dX L^-T the second-order model of ``tr X - log det X`` is ``|E + L'L - 1|^2 / 2``, so every
        step is a least-squares problem with bounds: no matrix is squared.
        """
        cost = self._cost(x, weight)
        for taken in range(_STEPS):
            log_rows, log_target = self._log_det_rows(x)
            rows = np.vstack([self._rows, weight**0.5 * log_rows])
            target = np.concatenate([self._target - self._rows @ x, weight**0.5 * log_target])
            step = _bounded_least_squares(rows, target, self._lower - x)
            gain = 0.5 * float(target @ target - np.sum((rows @ step - target) ** 2))
            if gain < _CONVERGED * min(weight, 1.0) + _ROUNDING * abs(cost):
                return (x + step if self._inside(x + step) else x), taken
            # a step that ends close to the border would need many more to come back from there
            inward = min(np.linalg.eigvalsh(e.reshape(4, 4))[0] for e in np.split(log_rows @ step, len(self._starts)))
            size = min(1.0, 0.9 / max(-float(inward), 1e-300))
            while (trial := self._cost(x + size * step, weight)) > cost - 0.1 * size * gain:
                size *= 0.5
                if size < 1e-10:
                    return x, taken if gain < _STALLED * (weight + abs(cost)) else None
            x, cost = x + size * step, trial
        return x, None

    def _cost(self, x: FloatArray, weight: float) -> float:
        if not self._inside(x):
            return np.inf
        residual = self._rows @ x - self._target
        matrices = [symmetric(x[s : s + 10]) for s in self._starts]
        return 0.5 * float(residual @ residual) + weight * sum(float(np.trace(m) - np.linalg.slogdet(m)[1]) for m in matrices)

    def _inside(self, x: FloatArray) -> bool:
        return all(_is_positive(symmetric(x[s : s + 10])) for s in self._starts)

    def _log_det_rows(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        rows = np.zeros((16 * len(self._starts), len(x)))
        target = np.zeros(16 * len(self._starts))
        for k, start in enumerate(self._starts):
            factor = np.linalg.cholesky(symmetric(x[start : start + 10]))
            inverse = np.linalg.inv(factor)
            block = slice(16 * k, 16 * k + 16)
            rows[block, start : start + 10] = np.stack([(inverse @ b @ inverse.T).ravel() for b in BASIS], axis=1)
            target[block] = (np.eye(4) - factor.T @ factor).ravel()
        return rows, target


def _bounded_least_squares(rows: FloatArray, target: FloatArray, lower: FloatArray) -> FloatArray:
    """argmin |rows x - target| with x >= lower, for rows of full rank.

    One triangle with the unbounded unknowns first: its last block is all that Lawson and Hanson's non-negative least squares
    needs to see, and the first gives the others.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    size = np.linalg.norm(rows, axis=0)
    size[size == 0.0] = 1.0
    order = np.argsort(np.isfinite(lower), kind="stable")
    count, first = len(order), int(np.sum(np.isneginf(lower)))
    reduced: Any = np.linalg.qr(np.column_stack([(rows / size)[:, order], target]), mode="r")
    triangle = np.asarray(reduced)[:count]
    right, side = triangle[:, :count], triangle[:, count]
    diagonal = np.abs(np.diag(right))
    right[np.diag_indices(count)] = np.where(diagonal > 1e-15 * diagonal.max(), np.diag(right), 1e-15 * diagonal.max())
    least = (lower * size)[order]
    x = solve_triangular(right, side)
    if np.any(x[first:] < least[first:]):
        block = right[first:, first:]
        above, _ = nnls(block, side[first:] - block @ least[first:])
        x[first:] = least[first:] + above
        x[:first] = solve_triangular(right[:first, :first], side[:first] - right[:first, first:] @ x[first:]) if first else 0.0
    out = np.empty(count)
    out[order] = x
    return np.asarray(out / size)


def _is_positive(matrix: FloatArray) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
