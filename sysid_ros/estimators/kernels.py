"""Compiled inner loops of the estimators. Arrays are changed in place; nothing is allocated in the loops over rows.

Inner loops run along the last axis without a sum, so that the compiler makes vector instructions of them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}

ABSURD: Final = 1e9
"""What is larger than this is no value of a row: its square would overflow what it is added to."""
MOST_SPREAD: Final = 9.0
"""A squared residual counts as so many times its mean at most."""

TAKEN_IN, BLOCK_FULL, NOT_ORDINARY, NOT_USABLE, BROKEN_DOWN = range(5)
"""What :func:`take_in` did: took the rows in, and filled a block with them; nothing, as they do not fit what is known, or are
not finite or absurd; or it took them in, and theta is not finite any more."""
SPREAD, NOISE, FLOOR = range(3)
"""Rows of ``levels``, shape (3, m): total variance of the innovations, variance that weighs a row, and the least of both."""
FILLED, LENGTH = range(2)
"""Rows of ``progress``, shape (2, number of lengths): updates in each block so far, and in a full one."""


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
    carried = np.empty(c)
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
def joseph_update(theta: FloatArray, P: FloatArray, Y: FloatArray, tau: FloatArray, variance: FloatArray) -> None:
    """Measurement update row by row: ``K = P y / (y' P y + r)``, ``P <- (1 - K y') P (1 - K y')' + K r K'`` (Joseph), expanded.

    Args:
        theta: shape (p,). P: shape (p, p), symmetric. Y: shape (m, p). tau: shape (m,). variance: noise of each row, shape
            (m,); a row of infinite variance changes nothing.
    """
    joseph_update_considering(theta, P, Y, tau, variance, np.empty((theta.size, 0)), np.empty((tau.size, 0)))


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
def normalised_innovation(Y: FloatArray, P: FloatArray, spread: FloatArray, extra: FloatArray, innovation: FloatArray) -> float:
    """``z = nu' S^-1 nu / m`` with ``S = Y P Y' + diag(spread + extra)``, by Cholesky; NaN where S is not positive definite."""
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
def accumulate_normal_equations(Y: FloatArray, tau: FloatArray, Z: FloatArray, weight: FloatArray, rows: FloatArray) -> None:
    """Normal equations of each row, for weighting them anew: ``rows[i] += w_i y_i [y_i' | tau_i | z_i']``, shape (m, p,
    p + 1 + c)."""
    m, p = Y.shape
    for i in range(m):
        for a in range(p):
            y = weight[i] * Y[i, a]
            if y == 0.0:
                continue
            row = rows[i, a]
            for k in range(p):
                row[k] += y * Y[i, k]
            row[p] += y * tau[i]
            for k in range(Z.shape[1]):
                row[p + 1 + k] += y * Z[i, k]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def is_ordinary(
    Y: FloatArray, P: FloatArray, spread: FloatArray, extra: FloatArray, innovation: FloatArray, threshold: float
) -> bool:
    """False where the normalised innovation is above the threshold. It is at most what it would be with P = 0, which settles most
    cases without a factorisation."""
    most = 0.0
    for i in range(innovation.size):
        most += innovation[i] * innovation[i] / (spread[i] + extra[i])
    if most <= threshold * innovation.size:
        return True
    return not normalised_innovation(Y, P, spread, extra, innovation) > threshold


@njit(**_JIT)  # type: ignore[untyped-decorator]
def add_to_blocks(
    Y: FloatArray,
    tau: FloatArray,
    spread: FloatArray,
    extra: FloatArray,
    theta: FloatArray,
    P: FloatArray,
    total: FloatArray,
    starts: FloatArray,
    known: FloatArray,
    progress: FloatArray,
) -> bool:
    """Add the rows ``[Y | tau]``, brought to the noise ``spread``, to the running ``total``, shape (m, p + 1). Where a block of a
    level begins, keep the total in ``starts``, shape (levels, m, p + 1), and what is known, ``[P | theta]``, in ``known``, shape
    (levels, p, p + 1). True where a block is full now."""
    m, p = Y.shape
    begun, full = False, False
    for level in range(progress.shape[1]):
        begun = begun or progress[FILLED, level] > 0.0
    if not begun:
        total[:] = 0.0
    for level in range(progress.shape[1]):
        if progress[FILLED, level] == 0.0:
            starts[level] = total
            known[level, :, :p] = P
            known[level, :, p] = theta
        progress[FILLED, level] += 1.0
        full = full or progress[FILLED, level] >= progress[LENGTH, level]
    for i in range(m):
        weight = np.sqrt(spread[i] / (spread[i] + extra[i]))
        for a in range(p):
            total[i, a] += weight * Y[i, a]
        total[i, p] += weight * tau[i]
    return full


@njit(**_JIT)  # type: ignore[untyped-decorator]
def learn_spread(residual: FloatArray, extra: FloatArray, levels: FloatArray, rate: float, clip: bool) -> None:
    """Running mean of the squared residuals, shape (m,), of rows whose noise is larger by ``extra``; at most
    :data:`MOST_SPREAD` times the mean so far where ``clip``."""
    for i in range(residual.size):
        spread = levels[SPREAD, i]
        squared = residual[i] * residual[i] * (spread / (spread + extra[i]))
        if clip:
            squared = min(squared, MOST_SPREAD * spread)
        levels[SPREAD, i] = max((1.0 - rate) * spread + rate * squared, levels[FLOOR, i])


@njit(**_JIT)  # type: ignore[untyped-decorator]
def take_in(
    Y: FloatArray,
    tau: FloatArray,
    extra: FloatArray,
    Z: FloatArray,
    theta: FloatArray,
    P: FloatArray,
    S: FloatArray,
    equations: FloatArray,
    levels: FloatArray,
    total: FloatArray,
    starts: FloatArray,
    known: FloatArray,
    progress: FloatArray,
    innovation: FloatArray,
    threshold: float,
    inflation: float,
    rate: float,
    clip: bool,
) -> int:
    """One update, ``tau = Y theta + Z z + noise``: the measurement update with all that the rows say of the noise.

    Args:
        extra: added to the noise of each row, shape (m,).
        theta, P, S: as in :func:`joseph_update_considering`.
        equations: as ``rows`` in :func:`accumulate_normal_equations`.
        levels: see :data:`SPREAD`. total, starts, known, progress: see :func:`add_to_blocks` and :data:`FILLED`.
        innovation: written, shape (m,).
        threshold: rows of which the normalised innovation is larger are left alone.
        inflation: factor on the noise of the rows; those of more than 1 tell nothing of the noise.
        rate, clip: see :func:`learn_spread`; a rate of 0 where nothing is learned of the noise.

    Returns:
        One of :data:`TAKEN_IN` and those beside it.
    """
    m = tau.size
    spread = levels[SPREAD]
    if not innovate(Y, tau, theta, innovation):
        return NOT_USABLE
    if not is_ordinary(Y, P, spread, extra, innovation, threshold):
        return NOT_ORDINARY
    full = False
    if rate > 0.0 and inflation == 1.0:
        full = add_to_blocks(Y, tau, spread, extra, theta, P, total, starts, known, progress)
    weight, variance = np.empty(m), np.empty(m)
    for i in range(m):
        variance[i] = (levels[NOISE, i] + extra[i]) * inflation
        weight[i] = levels[NOISE, i] / variance[i]
    joseph_update_considering(theta, P, Y, tau, variance, S, Z)
    accumulate_normal_equations(Y, tau, Z, weight, equations)
    if rate > 0.0:
        residual = variance
        innovate(Y, tau, theta, residual)
        learn_spread(residual, extra, levels, rate, clip)
    for a in range(theta.size):
        if not np.isfinite(theta[a]):
            return BROKEN_DOWN
    return BLOCK_FULL if full else TAKEN_IN
