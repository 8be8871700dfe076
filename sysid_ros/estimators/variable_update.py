"""The update of :class:`.VariableForgetting` as one compiled function, :func:`take_in`, and its steps."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numba import njit

from sysid_ros.estimators.kernels import innovate, is_ordinary, joseph_update_in
from sysid_ros.estimators.update_state import (
    COLOUR,
    FILLED,
    FLOOR,
    LENGTH,
    MOST_WAITING,
    NOISE,
    PERIOD,
    SPREAD,
    WAITING,
    add_waiting,
    parts,
)
from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}

MOST_SPREAD: Final = 9.0
"""A squared residual counts as so many times its mean at most."""

TAKEN_IN, BLOCK_FULL, NOT_ORDINARY, NOT_USABLE, BROKEN_DOWN = range(5)
"""What :func:`take_in` did: took the rows in, and filled a block with them; nothing, as they do not fit what is known, or are
not finite or absurd; or it took them in, and theta is not finite any more."""
SPREAD_MEMORY: Final = 10.0
"""Time constant of the mean of squared residuals [s]."""
CLIP_AFTER: Final = 0.5
"""From when on a squared residual counts as :data:`MOST_SPREAD` times their mean at most [s]."""


class _Said(NamedTuple):
    not_finite: str = "the rows hold values that are not finite, or absurd"
    unknown_noise: str = "the noise of the torques is not known yet"
    jumped: str = "the parameters have just jumped"
    broken_down: str = "the recursion broke down and started again"


SAID: Final = _Said()
"""Reasons of a status."""


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
    """Add the rows ``[Y | tau | part]``, brought to the noise ``spread``, which is that part of their variance, to the running
    ``total``, shape (m, p + 2). Where a block of a level begins, keep the total in ``starts``, shape (levels, m, p + 2), and what
    is known, ``[P | theta]``, in ``known``, shape (levels, p, p + 1). True where a block is full now."""
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
        total[i, p + 1] += weight * weight
    return full


@njit(**_JIT)  # type: ignore[untyped-decorator]
def noise_squared(residual: float, spread: float, extra: float) -> float:
    """Expectation of ``n^2`` given ``residual = n + h``, where n has the variance ``spread`` and h ``extra``."""
    part = spread / (spread + extra)
    return part * part * residual * residual + (1.0 - part) * spread


@njit(**_JIT)  # type: ignore[untyped-decorator]
def learn_spread(residual: FloatArray, extra: FloatArray, levels: FloatArray, rate: float, clip: bool) -> None:
    """Running mean of the squared residuals, shape (m,), of rows whose noise is larger by ``extra``; at most
    :data:`MOST_SPREAD` times the mean so far where ``clip``. Of the noise's square the expectation is taken (expectation
    maximisation: Dempster, Laird, Rubin 1977): where ``extra`` is all but everything, a residual tells nothing of it."""
    for i in range(residual.size):
        spread = levels[SPREAD, i]
        squared = noise_squared(residual[i], spread, extra[i])
        if clip:
            squared = min(squared, MOST_SPREAD * spread)
        levels[SPREAD, i] = max((1.0 - rate) * spread + rate * squared, levels[FLOOR, i])


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _let_wait(Y: FloatArray, tau: FloatArray, Z: FloatArray, weight: FloatArray, waiting: FloatArray, memory: FloatArray) -> None:
    """Put the rows to those that wait to be added to the sums; add all where that makes them as many as may wait."""
    (m, p), c = Y.shape, Z.shape[1]
    place = waiting[int(memory[WAITING])]
    for i in range(m):
        for a in range(p):
            place[i, a] = Y[i, a]
        place[i, p] = tau[i]
        for k in range(c):
            place[i, p + 1 + k] = Z[i, k]
        place[i, p + 1 + c] = weight[i]
    memory[WAITING] += 1.0
    if memory[WAITING] >= MOST_WAITING:
        add_waiting(memory)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def take_in(
    Y: FloatArray,
    tau: FloatArray,
    extra: FloatArray,
    Z: FloatArray,
    memory: FloatArray,
    innovation: FloatArray,
    threshold: float,
    inflation: float,
    count: int,
) -> int:
    """One update, ``tau = Y theta + Z z + noise``: the measurement update with all that the rows say of the noise.

    Args:
        extra: added to the noise of each row, shape (m,).
        memory: of an :class:`.UpdateState`.
        innovation: written, shape (m,).
        threshold: rows of which the normalised innovation is larger are left alone.
        inflation: factor on the noise of the rows; those of more than 1 tell nothing of the noise.
        count: how many residuals have told of the noise; negative where nothing is learned of it.

    Returns:
        One of :data:`TAKEN_IN` and those beside it.
    """
    m, p = Y.shape
    theta, P, S, _, levels, total, starts, known, progress, waiting, room = parts(memory)
    spread, period, colour = levels[SPREAD], memory[PERIOD], memory[COLOUR]
    if not innovate(Y, tau, theta, innovation):
        return NOT_USABLE
    if not is_ordinary(Y, P, spread, extra, innovation, threshold):
        return NOT_ORDINARY
    full = False
    if count >= 0 and inflation == 1.0:
        full = add_to_blocks(Y, tau, spread, extra, theta, P, total, starts, known, progress)
    weight, variance = room[:m], room[m : 2 * m]
    for i in range(m):
        variance[i] = (levels[NOISE, i] + colour * extra[i]) * inflation
        weight[i] = levels[NOISE, i] / variance[i]
    joseph_update_in(theta, P, Y, tau, variance, S, Z, room[2 * m :])
    _let_wait(Y, tau, Z, weight, waiting, memory)
    if count >= 0:
        residual = variance
        innovate(Y, tau, theta, residual)
        rate = max(1.0 / (count + 1), period / SPREAD_MEMORY)
        learn_spread(residual, extra, levels, rate, count * period > CLIP_AFTER)
    for a in range(p):
        if not np.isfinite(theta[a]):
            return BROKEN_DOWN
    return BLOCK_FULL if full else TAKEN_IN


@njit(**_JIT)  # type: ignore[untyped-decorator]
def remove(
    Y: FloatArray,
    tau: FloatArray,
    Z: FloatArray,
    variance: FloatArray,
    level: FloatArray,
    prior_variance: FloatArray,
    theta: FloatArray,
    P: FloatArray,
    S: FloatArray,
    sums: FloatArray,
) -> None:
    """Take out of P, theta, S and the sums what rows ``Y[k], tau[k], Z[k]`` would have brought in, k sets of m rows of this
    ``variance``: :func:`joseph_update_considering` with a negative one. Never more than half of what is known in the
    direction of a row, nor more than what was not known before any data.

    Args:
        Y: shape (k, m, p). tau: (k, m). Z: (k, m, c). variance, level: of each row, and the part of it that is noise, (m,).
        prior_variance: shape (p,).
        theta, P, S: as in :func:`joseph_update_considering`. sums: as ``rows`` in :func:`.add_waiting`.
    """
    p, c = S.shape
    projected, carried = np.empty(p), np.empty(c)
    for k in range(Y.shape[0]):
        for i in range(Y.shape[1]):
            y = Y[k, i]
            projected[:] = 0.0
            innovation, square, before = tau[k, i], 0.0, 0.0
            for b in range(p):
                before += prior_variance[b] * y[b] * y[b]
                if y[b] != 0.0:
                    for a in range(p):
                        projected[a] += P[b, a] * y[b]
            for a in range(p):
                square += projected[a] * y[a]
                innovation -= y[a] * theta[a]
            carried[:] = Z[k, i]
            for a in range(p):
                if y[a] != 0.0:
                    for b in range(c):
                        carried[b] += y[a] * S[a, b]
            if square >= before:
                continue
            r = max(variance[i], 2.0 * square, square * before / (before - square))
            s = square - r
            for a in range(p):
                g = projected[a] / s
                theta[a] += g * innovation
                for b in range(c):
                    S[a, b] -= g * carried[b]
                for b in range(p):
                    P[a, b] -= projected[a] * projected[b] / s
            weight = level[i] / r
            for a in range(p):
                if y[a] != 0.0:
                    for b in range(p):
                        sums[i, a, b] -= weight * y[a] * y[b]
                    sums[i, a, p] -= weight * y[a] * tau[k, i]
                    for b in range(c):
                        sums[i, a, p + 1 + b] -= weight * y[a] * Z[k, i, b]
