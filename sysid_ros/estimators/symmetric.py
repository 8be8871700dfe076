"""Inverses of symmetric matrices whose rows have units of their own."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from sysid_ros.sample import FloatArray


def scaled_to_one(matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Symmetric matrices, shape (..., m, m), scaled to a diagonal of about 1, and by what rows and columns were, shape (..., m).
    Directions that no row shows stay where they are."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrices, axis1=-2, axis2=-1), 1e-30))
    scaled = matrices * scale[..., :, None] * scale[..., None, :]
    scaled[..., np.arange(scaled.shape[-1]), np.arange(scaled.shape[-1])] += 1e-9
    return scaled, scale


def inverse_of(matrices: FloatArray) -> FloatArray:
    """Of symmetric matrices, shape (..., m, m), by :func:`scaled_to_one`."""
    scaled, scale = scaled_to_one(matrices)
    inverse = np.empty_like(scaled)
    for i in np.ndindex(scaled.shape[:-2]):
        inverse[i] = _inverse_of_one(scaled[i])
    inverse *= scale[..., :, None]
    inverse *= scale[..., None, :]
    return inverse


def _inverse_of_one(matrix: FloatArray) -> FloatArray:
    """By Cholesky's factors, in half the time, where rounding leaves it positive definite; shape (m, m)."""
    if not len(matrix):
        return matrix
    root, failed = linalg.lapack.dpotrf(matrix.T, lower=1)
    if failed:
        return np.asarray(np.linalg.inv(matrix))
    half = linalg.lapack.dpotri(root, lower=1, overwrite_c=1)[0]  # its lower half, below zeros
    whole = half + half.T
    whole[np.diag_indices_from(whole)] *= 0.5
    return np.asarray(whole)
