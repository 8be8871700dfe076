"""Exponential resetting: forgetting that never exceeds the prior."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def forget_towards_prior(
    P: FloatArray,
    prior_variance: FloatArray,
    epsilon: float,
    theta: FloatArray,
    S: FloatArray,
    known: FloatArray,
    rows: FloatArray,
) -> None:
    """Time update ``P <- P + eps (P - P P0^-1 P)``: forgetting that never exceeds the prior, P <= P0 (Salgado, Goodwin,
    Middleton 1988; Shin, Lee 2020), of the covariance and of the sums that it comes from (:class:`.RowSums`).

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
