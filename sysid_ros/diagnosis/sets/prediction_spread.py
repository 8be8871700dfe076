"""What uncertain parameters make of the prediction of rows that were not fitted.

Rows of another motion ask for directions that the fitted ones leave open. What a set of causes predicts there is as uncertain as
its parameters, and an error of that size says nothing against it: whitened rows ``r = y - X theta`` of a held-out stretch have
the covariance ``lambda + X C X'`` with the covariance C of the parameters and the level lambda of the noise in that stretch. A
stretch in which more is left than noise (lambda > 1) does not make the parameters any more uncertain: what no cause explains
would be explained else by any that is not known well.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sysid_ros.diagnosis.sets.stretches import Indices, Stretches
from sysid_ros.sample import FloatArray

Spread = dict[int, FloatArray]
"""``K = X C X'`` of the held-out stretches of each joint, shape (..., H, L, L)."""
Axes = dict[int, tuple[FloatArray, FloatArray]]
"""Of each joint the variances along the principal axes of K, shape (H, L), and these axes, shape (H, L, L)."""


def held_out_rows(of_each: Stretches, joint: int, at: Indices) -> tuple[FloatArray, Indices]:
    """Those columns that load a joint, in its held-out stretches, shape (H, c, L), and their places in ``at``, shape (c,)."""
    place = of_each.place[joint][at]
    loads = np.flatnonzero(place >= 0)
    return of_each.held_out_x[joint][:, place[loads]], np.asarray(loads)


def spread_of(of_each: Stretches, at: Indices, covariance: FloatArray) -> Spread:
    """K of a set of columns with the covariance of their parameters from all fitted rows, shape (a, a)."""
    out = {}
    for j in of_each.held_out_x:
        X, loads = held_out_rows(of_each, j, at)
        out[j] = X.swapaxes(1, 2) @ (covariance[np.ix_(loads, loads)] @ X)
    return out


def spread_without(
    of_each: Stretches, spread: Mapping[int, FloatArray], at: Indices, covariance: FloatArray, gone: Indices
) -> Spread:
    """K with some of the columns left out; ``gone``: their places in ``at``, ``covariance`` as of :func:`spread_of`."""
    own = covariance[np.ix_(gone, gone)]
    own = own + np.diag(np.maximum(1e-9 * np.diag(own), 1e-30))
    out = {}
    for j, K in spread.items():
        X, loads = held_out_rows(of_each, j, at)
        V = covariance[np.ix_(gone, loads)] @ X
        out[j] = K - V.swapaxes(1, 2) @ np.linalg.solve(own, V)
    return out


def principal_axes(spread: Mapping[int, FloatArray]) -> Axes:
    """Of spreads of shape (H, L, L) a joint."""
    out = {}
    for j, K in spread.items():
        variance, axes = np.linalg.eigh(0.5 * (K + K.swapaxes(1, 2)))
        out[j] = np.maximum(variance, 0.0), axes
    return out


def powers(K: FloatArray, left: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Power of rows of which one is as uncertain as another, and half the logarithm of the determinant of what they spread by
    beside the noise, shape (k, H) each.

    Args:
        K: of one joint, shape (k, H, L, L). left: its rows, shape (k, H, L). size: how many of a stretch count, shape (H,).
    """

    def of(level: FloatArray) -> tuple[FloatArray, FloatArray]:
        root = _root(K / level[..., None, None])
        white = np.linalg.solve(root, left[..., None])[..., 0]
        return np.sum(white**2, axis=-1), np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)

    return of(_level(of(np.ones(left.shape[:2]))[0], size))


def powers_with_more(
    axes: tuple[FloatArray, FloatArray], left: FloatArray, columns: FloatArray, information: FloatArray, size: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """As :func:`powers` with more columns, one of several groups of them at a time, shape (H, m) each.

    Args:
        axes: without them. left: of the rows with each group, shape (H, m, L).
        columns: of the groups, without what the others follow of them, shape (H, m, c, L).
        information: of their parameters beside the others, shape (m, c, c). size: as of :func:`powers`.
    """
    variance, turn = axes
    columns, left = columns @ turn[:, None], left @ turn

    def of(level: FloatArray) -> tuple[FloatArray, FloatArray]:
        spread = 1.0 + variance[:, None] / level[..., None]
        V, told = columns / np.sqrt(spread)[:, :, None], information * level[..., None, None]
        r = left / np.sqrt(spread)
        both, v = told + V @ V.swapaxes(2, 3), (V @ r[..., None])[..., 0]
        power = np.sum(r**2, axis=2) - np.sum(v * np.linalg.solve(both, v[..., None])[..., 0], axis=2)
        more = np.linalg.slogdet(both)[1] - np.linalg.slogdet(told)[1]
        return np.maximum(power, 0.0), 0.5 * (np.log(spread).sum(axis=2) + more)

    return of(_level(of(np.ones(left.shape[:2]))[0], size[:, None]))


def _level(power: FloatArray, size: FloatArray) -> FloatArray:
    """Of the noise in a stretch, over what it was learned as, where so much power is left."""
    return np.maximum(power / size, 1.0)


def _root(K: FloatArray) -> FloatArray:
    """Cholesky factors of 1 + K, of which no direction is below 1, but by rounding."""
    A = K + np.eye(K.shape[-1])
    try:
        return np.asarray(np.linalg.cholesky(A))
    except np.linalg.LinAlgError:
        value, vector = np.linalg.eigh(0.5 * (A + A.swapaxes(-1, -2)))
        return np.asarray(np.linalg.cholesky((vector * np.maximum(value, 1.0)[..., None, :]) @ vector.swapaxes(-1, -2)))
