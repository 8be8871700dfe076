"""Rows of the whole robot without what an error of one of them does to the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import fit, residuals
from sysid_ros.identification.rows import BagRows
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_ROWS = 6.0
"""Rows by which the six are independent before any data: as many as there are, the least that a covariance is made of."""


def mixing(
    base: FloatingBase, model: TorqueModel, fitted: Sequence[BagRows], judged: Sequence[BagRows]
) -> tuple[dict[str, FloatArray], ...]:
    """What the rows of each recording are multiplied by, shape (6, 6) a recording, by the names of the fitted and of the judged.

    A joint's torque that is off, whatever makes it so, is a force and a moment at once: what is left of the six rows is one
    error, not six. Of rows with ``cov(e) = L D L'``, L unit lower triangular, those of ``L^-1 y`` have errors of their own: each
    is a row less what the errors of the rows before it say of its. The covariance is that of what all that is free leaves, so
    that it is not that of a cause that is known here.

    Args:
        base: the robot. model: all that is free; its columns are the first ones of the rows.
    """
    prior = Prior.of(model, base)
    own = [[_with(bag, model.p) for bag in bags] for bags in (fitted, judged)]
    theta = fit(own[0], prior.mean, prior.std).theta
    return tuple({name: _mixing([b for b in bags if b.name == name], theta) for name in {b.name for b in bags}} for bags in own)


def _with(bag: BagRows, p: int) -> BagRows:
    """The rows with the first p columns."""
    return replace(bag, Y=bag.Y[:, :, :p])


def _mixing(bags: Sequence[BagRows], theta: FloatArray) -> FloatArray:
    left = np.concatenate([residuals(bag, theta)[bag.moving[:, :FREE].all(axis=1), :FREE] for bag in bags])
    square = left.T @ left
    square += _ROWS / max(len(left), 1) * np.diag(np.diagonal(square)) + 1e-12 * np.eye(FREE)
    root = np.linalg.cholesky(square)
    return np.asarray(np.linalg.inv(root / np.diagonal(root)))
