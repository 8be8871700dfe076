"""RowSums: all rows so far, a joint at a time, so that they can be weighted anew when their noise is known better."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.estimators.update_state import NOISE, UpdateState
from sysid_ros.sample import FloatArray

_LEAST = 1e-3
"""Information of a direction, over the prior's, below which there is none."""


class RowSums:
    """``P^-1 = L + sum_i A_i / r_i`` and ``P^-1 theta = h + sum_i b_i / r_i``, with the noise r_i of row i left open.

    A recursion weighs a row by the noise that is known when it comes. In this form the same rows can be weighted by the noise
    that is known later; what the considered errors z do to theta, ``S = -P (H + sum_i C_i / r_i)``, goes along.

    Args:
        prior_variance: diagonal of P0, shape (p,). state: that :func:`variable_update.take_in` works on; its estimate is the
            beginning, and its ``rows`` are ``[A_i | b_i | C_i]`` of each row.

    Attributes:
        known: ``[L | h | H]``, shape (p, p + 1 + c). span: updates that the sums are of.
    """

    def __init__(self, prior_variance: FloatArray, state: UpdateState) -> None:
        self._prior_variance = prior_variance
        self._p, self._state = prior_variance.size, state
        self.start()

    def start(self) -> None:
        """Begin from what is known now: estimate, covariance and sensitivity of the state."""
        now = self._state
        L = self._invert(now.P, np.sqrt(self._prior_variance))
        self.known = np.hstack([L, L @ np.column_stack([now.theta, -now.S])])
        now.rows[:] = 0.0
        self.span = 0.0

    def consider(self, state: UpdateState) -> None:
        """Go on with a state of another number of considered errors; what the ones before did is forgotten."""
        self._state = state
        self.known = np.hstack([self.known[:, : self._p + 1], np.zeros((self._p, state.S.shape[1]))])

    def forget(self, epsilon: float, updates: int) -> None:
        """``P <- P + eps (P - P P0^-1 P)``, in place: a part eps of the information is exchanged for the prior around theta;
        after so many updates since the last time."""
        now = self._state
        self.span = (self.span + updates) * (1.0 - epsilon)
        _forget_towards_prior(now.P, self._prior_variance, epsilon, now.theta, now.S, self.known, now.rows)

    def repeated(self, where: slice, density: FloatArray, step: float) -> FloatArray:
        """As of :meth:`.Estimator.repeated_covariance`. An error e(t) of row i that is white within a step, of the density d_i,
        and the same in all of N steps, moves theta by ``P sum_i N / r_i sum_step y_i e``: the covariance of that is
        ``N P (sum_i d_i / r_i^2 A_i) P``, that of one step alone however large N is."""
        now = self._state
        information = np.tensordot(density / now.levels[NOISE] ** 2, now.rows[:, :, : self._p], 1)
        P = now.P[where]
        return np.asarray(self.span / step * (P @ information @ P.T))

    def solve(self, variance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Estimate (p,), covariance (p, p) and sensitivity (p, c) for rows of this noise, shape (m,)."""
        p = self._p
        total = self.known.copy()
        for weight, rows in zip(1.0 / variance, self._state.rows, strict=True):
            total += weight * rows
        scale = np.sqrt(self._prior_variance)
        information = total[:, :p] * np.outer(scale, scale)
        if not _exceeds(information, _LEAST):
            values, vectors = np.linalg.eigh(information)
            known = values > _LEAST
            kept = vectors[:, known] @ vectors[:, known].T
            scaled = (vectors * np.where(known, values, 1.0)) @ vectors.T / np.outer(scale, scale)
            total = np.column_stack([scaled, (kept @ (total[:, p:] * scale[:, None])) / scale[:, None]])
        P = self._invert(total[:, :p], 1.0 / scale)
        return P @ total[:, p].copy(), P, -P @ total[:, p + 1 :]

    @staticmethod
    def _invert(matrix: FloatArray, scale: FloatArray) -> FloatArray:
        """Inverse of a symmetric positive definite matrix whose diagonal is of the size of ``scale^2``."""
        inverse = np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
        return np.asarray(0.5 * (inverse + inverse.T))


def _exceeds(information: FloatArray, least: float) -> bool:
    """Whether all eigenvalues of a symmetric matrix do: by Cholesky, which takes a twentieth of the time of finding them. Where
    not, more was compensated than there is, weighted like this: there nothing is known but the prior."""
    try:
        np.linalg.cholesky(information - least * np.eye(len(information)))
    except np.linalg.LinAlgError:
        return False
    return True


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _forget_towards_prior(
    P: FloatArray,
    prior_variance: FloatArray,
    epsilon: float,
    theta: FloatArray,
    S: FloatArray,
    known: FloatArray,
    rows: FloatArray,
) -> None:
    """Time update ``P <- P + eps (P - P P0^-1 P)``: forgetting that never exceeds the prior, P <= P0 (Salgado, Goodwin,
    Middleton 1988; Shin, Lee 2020), of the covariance and of the sums that it comes from.

    Args:
        P: shape (p, p). prior_variance: diagonal of P0, shape (p,). epsilon: 0 < eps < 1.
        theta, S: estimate and its derivative by the considered errors, shapes (p,) and (p, c), around which the prior stands.
        known: ``[L | h | H]``, shape (p, p + 1 + c). rows: of each row, shape (m, p, p + 1 + c).
    """
    p = P.shape[0]
    squared = np.zeros((p, p))
    for a in range(p):
        for c in range(p):
            part = P[a, c] / prior_variance[c]
            for b in range(a + 1):
                squared[a, b] += part * P[c, b]
    for a in range(p):
        for b in range(a + 1):
            value = P[a, b] + epsilon * (P[a, b] - squared[a, b])
            P[a, b] = value
            P[b, a] = value
    rows *= 1.0 - epsilon
    known *= 1.0 - epsilon
    for a in range(p):
        information = epsilon / prior_variance[a]
        known[a, a] += information
        known[a, p] += information * theta[a]
        for k in range(S.shape[1]):
            known[a, p + 1 + k] -= information * S[a, k]
