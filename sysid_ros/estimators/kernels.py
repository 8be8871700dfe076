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
def room_of_update(p: int, c: int) -> int:
    """Values that :func:`joseph_update_in` works in, of p parameters and c considered errors."""
    return 2 * p + c


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
    p, c = S.shape
    gain, projected, carried = room[:p], room[p : 2 * p], room[2 * p : 2 * p + c]
    for i in range(tau.size):
        if not np.isfinite(variance[i]):
            continue
        innovation = tau[i]
        s = variance[i]
        projected[:] = 0.0
        for b in range(p):
            if Y[i, b] != 0.0:
                for a in range(p):
                    projected[a] += P[b, a] * Y[i, b]
        for a in range(p):
            s += projected[a] * Y[i, a]
            innovation -= Y[i, a] * theta[a]
        carried[:] = Z[i]
        for a in range(p):
            if Y[i, a] != 0.0:
                for k in range(c):
                    carried[k] += Y[i, a] * S[a, k]
        for a in range(p):
            g = projected[a] / s
            gain[a] = g
            theta[a] += g * innovation
            for k in range(c):
                S[a, k] -= g * carried[k]
        for a in range(p):
            g, h = gain[a], projected[a]
            for b in range(p):
                P[a, b] += s * (g * gain[b]) - (g * projected[b] + h * gain[b])


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
    joseph_update_in(theta, P, Y, tau, variance, S, Z, np.empty(room_of_update(p, c)))


@njit(**_JIT)  # type: ignore[untyped-decorator]
def joseph_update(theta: FloatArray, P: FloatArray, Y: FloatArray, tau: FloatArray, variance: FloatArray) -> None:
    """Measurement update row by row: ``K = P y / (y' P y + r)``, ``P <- (1 - K y') P (1 - K y')' + K r K'`` (Joseph), expanded.

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
