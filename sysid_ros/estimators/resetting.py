"""Exponential resetting: forgetting that never exceeds the prior."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def forget_towards_prior(P: FloatArray, prior_variance: FloatArray, epsilon: float) -> None:
    """Time update ``P <- P + eps (P - P P0^-1 P)``: forgetting that never exceeds the prior, P <= P0 (Salgado, Goodwin,
    Middleton 1988; Shin, Lee 2020). ``prior_variance`` is the diagonal of P0, shape (p,); 0 < eps < 1.
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
