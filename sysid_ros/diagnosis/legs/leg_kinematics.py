"""What legs and IMU say without any dynamics: feet that stand keep their distances and do not pull, and a robot that stays where
it is feels its weight in the mean.

Of two feet that stand, d apart in the axes of the trunk, the joints say ``y = -dJ q'`` and the gyro ``x = w x d``. Both have
errors::

    x = g z + n_x,   y = z + n_y,   z ~ N(0, S),   n_x ~ N(0, N_x),   n_y ~ N(0, N_y)

with g = 1 for a gyro in rad/s, 180 / pi for one in degrees and -1 for one of the other sign. Where nothing turns all are alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.zero_phase import SmoothMotion

_FEWEST = 10
"""Fewest moments by which anything can be told."""
_GRAVITY, _SCALE_ERROR = 9.81, 0.03
"""What an accelerometer shows at rest [m/s^2], and by which part it is off, supposed."""


def gyro_likelihood(base: FloatingBase, motion: SmoothMotion, pairs: Sequence[NDArray[np.bool_]], gain: float) -> float:
    """Log-likelihood of what gyro and joints show of feet that stand, up to a constant.

    Args:
        motion: what is shown. pairs: of each two feet whether both stand, shape (N,) each, in the order of
            :func:`itertools.combinations`. gain: g.
    """
    moves = np.stack([_jacobians(base, q) for q in motion.q])
    parts, moments = [], int(np.any(pairs, axis=0).sum())
    if moments < _FEWEST:
        return 0.0
    for (i, j), both in zip(combinations(range(moves.shape[1]), 2), pairs, strict=True):
        apart, v = (moves[:, i] - moves[:, j])[both], motion.v[both]
        x = np.einsum("tij,tj->ti", apart[:, :, 3:FREE], v[:, 3:FREE]).ravel()
        parts.append(np.stack([x, -np.einsum("tij,tj->ti", apart[:, :, FREE:], v[:, FREE:]).ravel()]))
    rows = np.concatenate(parts, axis=1)
    return moments * _likelihood(rows @ rows.T / rows.shape[1] + 1e-12 * np.eye(2), gain)


def gravity_likelihood(forces: FloatArray, scale: float) -> float:
    """Log-likelihood of how large the specific force is in the mean: as gravity is, give or take what shakes across it, whose
    mean square over twice gravity is at most that of all that shakes.

    Args:
        forces: specific force, shape (N, 3) [m/s^2]. scale: what it is of the published one.
    """
    std = _SCALE_ERROR * _GRAVITY + float(np.sum(np.var(forces, axis=0))) / (2.0 * _GRAVITY)
    off = (float(np.mean(np.linalg.norm(forces, axis=1))) - _GRAVITY) / std
    return float(np.log(abs(scale) / std)) - 0.5 * off**2


def pairs_that_stand(forces: FloatArray, least: float) -> list[NDArray[np.bool_]]:
    """Of each two feet whether both carry at least so much [N], shape (N,) each, of forces of shape (N, k, 3)."""
    stands = np.linalg.norm(forces, axis=2) > least
    return [stands[:, i] & stands[:, j] for i, j in combinations(range(stands.shape[1]), 2)]


def feet_push(base: FloatingBase, motion: SmoothMotion, forces: FloatArray) -> bool:
    """Whether the forces on the feet, shape (N, k, 3), are those of feet that push: towards the trunk."""
    origins = np.stack([base.contacts.origins(q)[0] for q in motion.q])
    return float(np.sum(forces * origins)) < 0.0


def _jacobians(base: FloatingBase, q: FloatArray) -> FloatArray:
    """Of the feet, shape (k, 3, n), also of those that lie beside the frame that carries them."""
    points, moves = base.contacts.origins(q)
    turning = np.cross(moves[3:].T[None], points[:, None, :]).swapaxes(1, 2)
    return np.asarray((moves[:3] + turning) * base.contacts.carriers[:, None, :])


def _likelihood(shown: FloatArray, gain: float) -> float:
    """Greatest log-likelihood of one value of (x, y), of which ``shown`` is the mean square, shape (2, 2), up to a constant.

    Where variances explain all of it they do; else one of them is 0, and what it leaves is a regression.
    """
    (x, both), (_, y) = shown
    if 0.0 < gain * both <= x and both / gain <= y:
        return -0.5 * float(np.log(x * y - both**2))
    by_gyro, by_joints = y - 2.0 * both / gain + x / gain**2, x - 2.0 * gain * both + gain**2 * y
    return -0.5 * float(np.log(min(x * by_gyro, y * by_joints, x * y)))
