"""Ridge regression whose every prediction is of rows that it was not fitted to, for a whole path of ridges at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray

RIDGES = tuple(np.logspace(-6.0, 1.0, 8))
"""Parts of the rows' number, of columns over their size."""


@dataclass(frozen=True, eq=False)
class Weights:
    """``y = ((x - mean) / size) w + offset``.

    Attributes:
        mean, size: of columns, shape (c,). w: shape (c, ridges). offset: shape (ridges,).
    """

    mean: FloatArray
    size: FloatArray
    w: FloatArray
    offset: float

    def of(self, X: FloatArray) -> FloatArray:
        """Shape (N, ridges)."""
        return np.asarray(((X - self.mean) / self.size) @ self.w + self.offset)


def ridge_path(X: FloatArray, y: FloatArray, ridges: Sequence[float] = RIDGES) -> Weights:
    """All ridges from one decomposition, X of shape (N, c), y of shape (N,)."""
    mean, size = X.mean(axis=0), np.std(X, axis=0)
    size = np.where(size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300), size, np.inf)
    Z, offset = (X - mean) / size, float(y.mean())
    values, vectors = np.linalg.eigh(Z.T @ Z)
    score = vectors.T @ (Z.T @ (y - offset))
    weights = [vectors @ (score / (np.maximum(values, 0.0) + r * len(y))) for r in ridges]
    return Weights(mean, size, np.column_stack(weights), offset)


def left_out(X: FloatArray, y: FloatArray, fold: NDArray[np.intp], ridges: Sequence[float] = RIDGES) -> FloatArray:
    """Predictions of each fold by a fit to the others, shape (N, ridges). The decomposition is of sums, less those of the fold.

    None is beyond what the others hold: where a motion leaves what was fitted, functions of it run away.

    Args:
        X: shape (N, c). y: shape (N,). fold: number of each row, shape (N,).
    """
    size = np.sqrt(np.mean(X**2, axis=0))
    size = np.where(size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300), size, np.inf)
    # the offset is a column of its own that no ridge shrinks much
    Z = np.column_stack([X / size, np.full(len(X), 30.0)])
    out = np.empty((len(y), len(ridges)))
    G, h = Z.T @ Z, Z.T @ y
    for f in np.unique(fold):
        own = fold == f
        part = Z[own]
        values, vectors = np.linalg.eigh(G - part.T @ part)
        score = vectors.T @ (h - part.T @ y[own])
        turned = part @ vectors
        rows = len(y) - int(own.sum())
        low, high = float(y[~own].min(initial=0.0)), float(y[~own].max(initial=0.0))
        for k, r in enumerate(ridges):
            out[own, k] = turned @ (score / (np.maximum(values, 0.0) + r * rows))
        out[own] = np.clip(out[own], low, high)
    return out
