"""Compiled parts that estimators share: innovation, measurement update, and whether rows fit what is known.

Arrays are changed in place; nothing is allocated in the loops over rows. Inner loops run along the last axis without a sum, so
that the compiler makes vector instructions of them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}

ABSURD: Final = 1e9
"""What is larger than this is no value of a row: its square would overflow what it is added to."""
_SPARSE: Final = 0.25
"""Part of the values of a matrix up to which leaving out the zeros is faster than BLAS: 0.45 of them take twice as long on 7
joints, 0.13 half as long on 30."""
_FEW: Final = 32
"""So few columns are not worth counting."""


@njit(**_JIT)  # type: ignore[untyped-decorator]
def innovate(Y: FloatArray, tau: FloatArray, theta: FloatArray, innovation: FloatArray) -> bool:
    """``innovation <- tau - Y theta``, shape (m,); False where a value of the rows is not finite, or absurd."""
    usable = True
    for i in range(tau.size):
        usable = usable and abs(tau[i]) < ABSURD
        innovation[i] = tau[i]
        for a in range(theta.size):
            usable = usable and abs(Y[i, a]) < ABSURD
            innovation[i] -= Y[i, a] * theta[a]
    return usable


@njit(**_JIT)  # type: ignore[untyped-decorator]
def room_of_update(p: int, m: int, c: int) -> int:
    """Values that :func:`joseph_update_in` works in, of p parameters, m rows and c considered errors."""
    return 2 * m * (p + m + c + 1) + p * max(p, c)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _product(Y: FloatArray, M: FloatArray, out: FloatArray) -> None:
    """``out = Y M``, column by column of Y where most of it is zero, as where each joint has columns of its own."""
    m, p = Y.shape
    if p < _FEW or np.count_nonzero(Y) > _SPARSE * m * p:
        np.dot(Y, M, out)
        return
    out[:] = 0.0
    for i in range(m):
        for a in range(p):
            if Y[i, a] != 0.0:
                for b in range(out.shape[1]):
                    out[i, b] += Y[i, a] * M[a, b]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _whiten(projected: FloatArray, variance: FloatArray, W: FloatArray, sign: FloatArray) -> bool:
    """Lower W with ``W S W' = diag(sign)`` for the covariance ``S = projected + diag(variance)`` of innovations, shape (m, m), by
    Cholesky; a row of infinite variance is zero in W, and so is its sign. True where every sign is 1, as it is but for these rows
    and for rounding."""
    plain = True
    for i in range(variance.size):
        sign[i], W[i] = 0.0, 0.0
        if not np.isfinite(variance[i]):
            continue
        W[i, i], s = 1.0, projected[i, i] + variance[i]
        for j in range(i):
            if sign[j] == 0.0:
                continue
            part = 0.0
            for k in range(j + 1):
                part += W[j, k] * projected[i, k]
            s -= sign[j] * part * part
            for k in range(j + 1):
                W[i, k] -= sign[j] * part * W[j, k]
        sign[i], scale = np.sign(s), 1.0 / np.sqrt(abs(s))
        plain = plain and sign[i] > 0.0
        for k in range(i + 1):
            W[i, k] *= scale
    return plain


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _take_off(P: FloatArray, less: FloatArray) -> None:
    """``P <- P - less``, both symmetric: the lower triangle, mirrored, so that P stays symmetric to the last bit."""
    for a in range(P.shape[0]):
        for b in range(a + 1):
            value = P[a, b] - less[a, b]
            P[a, b] = value
            P[b, a] = value


@njit(**_JIT)  # type: ignore[untyped-decorator]
def joseph_update_in(
    theta: FloatArray,
    P: FloatArray,
    Y: FloatArray,
    tau: FloatArray,
    variance: FloatArray,
    S: FloatArray,
    Z: FloatArray,
    room: FloatArray,
) -> None:
    """As :func:`joseph_update_considering`, in the ``room`` of :func:`room_of_update` values."""
    (m, p), c, at = Y.shape, S.shape[1], 2 * Y.size
    both = room[:at].reshape((2, m, p))
    G, H = both[0], both[1]
    squares = room[at : at + 2 * m * m].reshape((2, m, m))
    projected, W = squares[0], squares[1]
    at += 2 * m * m
    sign, e = room[at : at + m], room[at + m : at + 2 * m]
    at += 2 * m
    _product(Y, P, G)
    np.dot(G, Y.T, projected)
    plain = _whiten(projected, variance, W, sign)
    np.dot(W, G, H)
    left = H
    if not plain:
        left = G
        for i in range(m):
            for a in range(p):
                left[i, a] = sign[i] * H[i, a]
    innovate(Y, tau, theta, e)
    for i in range(m):
        white = 0.0
        for k in range(i + 1):
            if sign[k] != 0.0:
                white += W[i, k] * e[k]
        for a in range(p):
            theta[a] += white * left[i, a]
    if c > 0:
        beside = room[at : at + 2 * m * c].reshape((2, m, c))
        C, carried = beside[0], beside[1]
        less = room[at + 2 * m * c : at + 2 * m * c + p * c].reshape((p, c))
        _product(Y, S, C)
        for i in range(m):
            for k in range(c):
                C[i, k] += Z[i, k]
        np.dot(W, C, carried)
        np.dot(left.T, carried, less)
        for a in range(p):
            for k in range(c):
                S[a, k] -= less[a, k]
        at += 2 * m * c
    square = room[at : at + p * p].reshape((p, p))
    np.dot(left.T, H, square)
    _take_off(P, square)


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
    joseph_update_in(theta, P, Y, tau, variance, S, Z, np.empty(room_of_update(p, tau.size, c)))


@njit(**_JIT)  # type: ignore[untyped-decorator]
def joseph_update(theta: FloatArray, P: FloatArray, Y: FloatArray, tau: FloatArray, variance: FloatArray) -> None:
    """Measurement update: ``K = P Y' S^-1``, ``S = Y P Y' + R``, ``P <- (1 - K Y) P (1 - K Y)' + K R K'`` (Joseph), which with
    this gain is ``P - H' H`` with ``H = W Y P`` and ``W S W' = 1``: products of small matrices.

    Args:
        theta: shape (p,). P: shape (p, p), symmetric. Y: shape (m, p). tau: shape (m,). variance: noise of each row, shape
            (m,); a row of infinite variance changes nothing.
    """
    joseph_update_considering(theta, P, Y, tau, variance, np.empty((theta.size, 0)), np.empty((tau.size, 0)))


def fix(theta: FloatArray, P: FloatArray, S: FloatArray, start: int, stop: int, variance: FloatArray) -> None:
    """Take in that the parameters from ``start`` to ``stop`` are zero, with a variance each, shape () or (k,); others as in
    :func:`joseph_update_considering`."""
    rows = np.ascontiguousarray(np.eye(theta.size)[start:stop])
    k = len(rows)
    joseph_update_considering(theta, P, rows, np.zeros(k), np.broadcast_to(variance, k).copy(), S, np.zeros((k, S.shape[1])))


@njit(**_JIT)  # type: ignore[untyped-decorator]
def innovate_and_update(
    Y: FloatArray,
    tau: FloatArray,
    Z: FloatArray,
    variance: FloatArray,
    theta: FloatArray,
    P: FloatArray,
    S: FloatArray,
    innovation: FloatArray,
    forgetting_factor: float,
) -> bool:
    """:func:`innovate`, then, where the rows are usable, ``P <- P / lambda`` and :func:`joseph_update_considering`."""
    if not innovate(Y, tau, theta, innovation):
        return False
    if forgetting_factor < 1.0:
        P /= forgetting_factor
    joseph_update_considering(theta, P, Y, tau, variance, S, Z)
    return True


@njit(**_JIT)  # type: ignore[untyped-decorator]
def predict(Y: FloatArray, P: FloatArray, spread: FloatArray, extra: FloatArray, innovation: FloatArray) -> tuple[float, float]:
    """``nu' S^-1 nu`` and ``log det S`` with ``S = Y P Y' + diag(spread + extra)``, by Cholesky; NaN where S is not positive
    definite."""
    m, p = Y.shape
    S = np.empty((m, m))
    row = np.empty(p)
    for i in range(m):
        row[:] = 0.0
        for a in range(p):
            if Y[i, a] != 0.0:
                for b in range(p):
                    row[b] += Y[i, a] * P[a, b]
        for j in range(i + 1):
            total = 0.0
            for b in range(p):
                total += row[b] * Y[j, b]
            S[i, j] = total
        S[i, i] += spread[i] + extra[i]
    z, logarithm = 0.0, 0.0
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
            return np.nan, np.nan
        S[i, i] = np.sqrt(diagonal)
        logarithm += np.log(diagonal)
        solved[i] = rest / S[i, i]
        z += solved[i] * solved[i]
    return z, logarithm


@njit(**_JIT)  # type: ignore[untyped-decorator]
def normalised_innovation(Y: FloatArray, P: FloatArray, spread: FloatArray, extra: FloatArray, innovation: FloatArray) -> float:
    """``z = nu' S^-1 nu / m``, see :func:`predict`."""
    return float(predict(Y, P, spread, extra, innovation)[0] / innovation.size)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def is_ordinary(
    Y: FloatArray, P: FloatArray, spread: FloatArray, extra: FloatArray, innovation: FloatArray, threshold: float
) -> bool:
    """False where the normalised innovation is above the threshold. It is at most what it would be with P = 0, which decides most
    cases without a factorisation."""
    most = 0.0
    for i in range(innovation.size):
        most += innovation[i] * innovation[i] / (spread[i] + extra[i])
    if most <= threshold * innovation.size:
        return True
    return not normalised_innovation(Y, P, spread, extra, innovation) > threshold
