"""Compiled inner loops of the estimators. Arrays are changed in place; nothing is allocated in the loops over rows."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}


@njit(**_JIT)  # type: ignore[untyped-decorator]
def joseph_update_considering(
    theta: FloatArray, P: FloatArray, Y: FloatArray, tau: FloatArray, variance: FloatArray, S: FloatArray, Z: FloatArray
) -> None:
    """Measurement update of :func:`joseph_update` for ``tau = Y theta + Z z + noise``: z is not estimated, its effect is kept.

    ``S <- (1 - K y') S - K z'`` is the derivative of the estimate by -z (Schmidt 1966: consider parameters).

    Args:
        S: shape (p, c). Z: shape (m, c).
    """
    p, c = S.shape
    gain = np.empty(p)
    projected = np.empty(p)
    for i in range(tau.size):
        if not np.isfinite(variance[i]):
            continue
        innovation = tau[i]
        s = variance[i]
        for a in range(p):
            total = 0.0
            for b in range(p):
                total += P[a, b] * Y[i, b]
            projected[a] = total
            s += total * Y[i, a]
            innovation -= Y[i, a] * theta[a]
        for a in range(p):
            gain[a] = projected[a] / s
            theta[a] += gain[a] * innovation
        for k in range(c):
            total = Z[i, k]
            for a in range(p):
                total += Y[i, a] * S[a, k]
            for a in range(p):
                S[a, k] -= gain[a] * total
        for a in range(p):
            for b in range(a + 1):
                value = P[a, b] - gain[a] * projected[b] - projected[a] * gain[b] + s * gain[a] * gain[b]
                P[a, b] = value
                P[b, a] = value


@njit(**_JIT)  # type: ignore[untyped-decorator]
def joseph_update(theta: FloatArray, P: FloatArray, Y: FloatArray, tau: FloatArray, variance: FloatArray) -> None:
    """Measurement update row by row: ``K = P y / (y' P y + r)``, ``P <- (1 - K y') P (1 - K y')' + K r K'`` (Joseph), expanded.

    Args:
        theta: shape (p,). P: shape (p, p), symmetric. Y: shape (m, p). tau: shape (m,). variance: noise of each row, shape
            (m,); a row of infinite variance changes nothing.
    """
    joseph_update_considering(theta, P, Y, tau, variance, np.empty((theta.size, 0)), np.empty((tau.size, 0)))


@njit(**_JIT)  # type: ignore[untyped-decorator]
def forget_towards_prior(P: FloatArray, prior_variance: FloatArray, epsilon: float, work: FloatArray) -> None:
    """Time update ``P <- P + eps (P - P P0^-1 P)``: forgetting that never exceeds the prior, P <= P0 (Salgado, Goodwin,
    Middleton 1988; Shin, Lee 2020). ``prior_variance`` is the diagonal of P0, shape (p,); 0 < eps < 1; ``work`` is as large as P.
    """
    p = P.shape[0]
    for a in range(p):
        for b in range(a + 1):
            total = 0.0
            for c in range(p):
                total += P[a, c] * P[b, c] / prior_variance[c]
            work[a, b] = total
    for a in range(p):
        for b in range(a + 1):
            value = P[a, b] + epsilon * (P[a, b] - work[a, b])
            P[a, b] = value
            P[b, a] = value


@njit(**_JIT)  # type: ignore[untyped-decorator]
def accumulate_normal_equations(
    Y: FloatArray, tau: FloatArray, Z: FloatArray, weight: FloatArray, A: FloatArray, b: FloatArray, C: FloatArray
) -> None:
    """Normal equations of each row, for weighting them anew: ``A[i] += w_i y_i y_i'`` (m, p, p; lower triangle),
    ``b[i] += w_i y_i tau_i`` (m, p), ``C[i] += w_i y_i z_i'`` (m, p, c)."""
    m, p = Y.shape
    c = Z.shape[1]
    for i in range(m):
        for a in range(p):
            y = weight[i] * Y[i, a]
            if y == 0.0:
                continue
            b[i, a] += y * tau[i]
            for k in range(a + 1):
                A[i, a, k] += y * Y[i, k]
            for k in range(c):
                C[i, a, k] += y * Z[i, k]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def normalised_innovation(Y: FloatArray, P: FloatArray, variance: FloatArray, innovation: FloatArray) -> float:
    """``z = nu' S^-1 nu / m`` with ``S = Y P Y' + diag(variance)``, by Cholesky; NaN where S is not positive definite."""
    m, p = Y.shape
    S = np.empty((m, m))
    row = np.empty(p)
    for i in range(m):
        for b in range(p):
            total = 0.0
            for a in range(p):
                total += Y[i, a] * P[a, b]
            row[b] = total
        for j in range(i + 1):
            total = 0.0
            for b in range(p):
                total += row[b] * Y[j, b]
            S[i, j] = total
        S[i, i] += variance[i]
    z = 0.0
    solved = np.empty(m)
    for i in range(m):
        for j in range(i):
            total = S[i, j]
            for k in range(j):
                total -= S[i, k] * S[j, k]
            S[i, j] = total / S[j, j]
        diagonal = S[i, i]
        rest = innovation[i]
        for k in range(i):
            diagonal -= S[i, k] * S[i, k]
            rest -= S[i, k] * solved[k]
        if not diagonal > 0.0:
            return np.nan
        S[i, i] = np.sqrt(diagonal)
        solved[i] = rest / S[i, i]
        z += solved[i] * solved[i]
    return float(z / m)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def accumulate_blocks(
    residual: FloatArray,
    sums: FloatArray,
    filled: FloatArray,
    lengths: FloatArray,
    power: FloatArray,
    count: FloatArray,
    keep: float,
) -> None:
    """Batch means at several block lengths: adds a residual (m,) to ``sums`` (levels, m); a block that is full adds its squared
    sum over its length to ``power`` (levels, m) and one to ``count`` (levels,), both fading by ``keep`` a sample of the block."""
    for level in range(lengths.size):
        for i in range(residual.size):
            sums[level, i] += residual[i]
        filled[level] += 1.0
        if filled[level] >= lengths[level]:
            fade = keep ** lengths[level]
            count[level] = fade * count[level] + 1.0
            for i in range(residual.size):
                power[level, i] = fade * power[level, i] + sums[level, i] * sums[level, i] / lengths[level]
                sums[level, i] = 0.0
            filled[level] = 0.0
