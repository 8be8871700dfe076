"""What uncertain parameters make of the prediction of rows that were not fitted.

Rows of another motion ask for directions that the fitted ones leave open. What a set of causes predicts there is as uncertain as
its parameters, and an error of that size says nothing against it: whitened rows ``r = y - X theta`` of a held-out stretch have
the covariance ``A = 1 + X C X'`` with the covariance C of the parameters, from the fitted rows and from the held-out ones before
them: so the same parameters make all of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sysid_ros.diagnosis.sets.stretches import Indices, Stretches
from sysid_ros.sample import FloatArray

Spread = dict[int, FloatArray]
"""A of the held-out stretches of each joint, shape (..., H, L, L)."""
White = dict[int, tuple[FloatArray, FloatArray]]
"""Of each joint the inverse of the Cholesky factor of A, shape (..., H, L, L), and half the logarithm of its determinant,
(..., H)."""


def held_out_rows(of_each: Stretches, joint: int, at: Indices) -> tuple[FloatArray, Indices]:
    """Those columns that load a joint, in its held-out stretches, shape (H, c, L), and their places in ``at``, shape (c,)."""
    place = of_each.place[joint][at]
    loads = np.flatnonzero(place >= 0)
    return of_each.held_out_x[joint][:, place[loads]], np.asarray(loads)


def spread_of(of_each: Stretches, at: Indices, covariance: FloatArray) -> Spread:
    """A of a set of columns with the covariance of the parameters that predict each held-out stretch, shape (H, a, a)."""
    out = {}
    for j in of_each.held_out_x:
        X, loads = held_out_rows(of_each, j, at)
        out[j] = X.swapaxes(1, 2) @ (covariance[:, loads[:, None], loads] @ X) + np.eye(X.shape[2])
    return out


def spread_without(
    of_each: Stretches, spread: Mapping[int, FloatArray], at: Indices, covariance: FloatArray, gone: Indices
) -> Spread:
    """A with some of the columns left out; ``gone``: their places in ``at``."""
    own = covariance[:, gone[:, None], gone]
    own = own + np.maximum(1e-9 * np.diagonal(own, axis1=1, axis2=2), 1e-30)[:, :, None] * np.eye(len(gone))
    out = {}
    for j, A in spread.items():
        X, loads = held_out_rows(of_each, j, at)
        V = covariance[:, gone[:, None], loads] @ X
        out[j] = A - V.swapaxes(1, 2) @ np.linalg.solve(own, V)
    return out


def whitened(spread: Mapping[int, FloatArray]) -> White:
    """What makes rows with this spread white."""
    out = {}
    for j, A in spread.items():
        root = _root(A)
        out[j] = np.linalg.inv(root), np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)
    return out


def _root(A: FloatArray) -> FloatArray:
    """Cholesky factors of matrices of which no direction is below 1, but by rounding."""
    try:
        return np.asarray(np.linalg.cholesky(A))
    except np.linalg.LinAlgError:
        value, vector = np.linalg.eigh(0.5 * (A + A.swapaxes(-1, -2)))
        return np.asarray(np.linalg.cholesky((vector * np.maximum(value, 1.0)[..., None, :]) @ vector.swapaxes(-1, -2)))


def with_more(
    white: tuple[FloatArray, FloatArray], left: FloatArray, columns: FloatArray, information: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Power of a joint's whitened held-out rows, and half the logarithm of the determinant of their spread, with more columns,
    one of several groups of them at a time: shape (H, m) each.

    Args:
        white: without them. left: of the rows with each group, shape (H, m, L).
        columns: of the groups, without what the others follow of them, shape (H, m, c, L).
        information: of their parameters beside the others, shape (H, m, c, c).
    """
    inverse, half = white
    turned = inverse.swapaxes(1, 2)[:, None]
    V, r = columns @ turned, (left[:, :, None] @ turned)[:, :, 0]
    both = information + V @ V.swapaxes(2, 3)
    v = (V @ r[..., None])[..., 0]
    told = np.linalg.solve(both, v[..., None])[..., 0]
    power = np.sum(r**2, axis=2) - np.sum(v * told, axis=2)
    more = np.linalg.slogdet(both)[1] - np.linalg.slogdet(information)[1]
    return np.maximum(power, 0.0), half[:, None] + 0.5 * more
