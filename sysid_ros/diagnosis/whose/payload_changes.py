"""When what is carried was picked up or set down in recordings, as far as a comparison of robots needs it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.sample import FloatArray

_CUTS, _CHANGING, _CHANGES = 12, 3, 3
"""Moments of a stretch from which on what is carried may be something else, in how many stretches, and how often in all."""


def changes_of_payload(rows: CoarseRows, residual: FloatArray, payload: FloatArray) -> list[FloatArray]:
    """1 from a time on to the end of its stretch, shape (N,) each: when a payload picked up or set down explains
    most of what is left, by least squares beside a payload and what each joint has of its own, one after the other.

    Args:
        residual: torque less the URDF's, shape (N, n). payload: columns of a payload, shape (N, n, 10).
    """
    n, scale = residual.shape[1], np.maximum(np.sqrt(np.mean(rows.tau**2, axis=0)), 1e-12)
    bases = [np.linalg.qr(rows.plain(j))[0] for j in range(n)]

    def free_of_own(columns: FloatArray) -> FloatArray:
        """Columns of shape (N, n, c) less what is each joint's own, shape (N n, c)."""
        parts = [x - B @ (B.T @ x) for x, B in zip(np.moveaxis(columns / scale[:, None], 1, 0), bases, strict=True)]
        return np.concatenate(parts)

    known, y = free_of_own(payload), free_of_own(residual[:, :, None])[:, 0]
    out: list[FloatArray] = []

    def likeliest(candidates: NDArray[np.intp]) -> tuple[int, FloatArray, FloatArray]:
        """The first row after the change that leaves least, its step, and columns of the payload with it."""
        found = []
        for first in candidates:
            later = ((rows.stretch == rows.stretch[first]) & (np.arange(len(rows.t)) >= first)).astype(float)
            columns = np.concatenate([known, free_of_own(payload * later[:, None, None])], axis=1)
            found.append((_left(columns, y), int(first), later, columns))
        return min(found, key=lambda x: x[0])[1:]

    stretches, count = np.unique(rows.stretch, return_counts=True)
    moving = [np.flatnonzero(rows.stretch == s) for s in stretches[np.argsort(-count)][:_CHANGING]]
    apart = max(1, -(-max(map(len, moving)) // _CUTS))
    tried = np.concatenate([own_rows[::apart] if len(stretches) > 1 else own_rows[apart::apart] for own_rows in moving])
    for _ in range(min(_CHANGES, len(tried))):
        best, _, _ = likeliest(tried)
        near = np.arange(max(best - apart + 1, 0), min(best + apart, len(rows.t)))
        first, later, known = likeliest(near[rows.stretch[near] == rows.stretch[best]])
        tried, out = tried[np.abs(tried - first) >= apart], [*out, later]
        if not tried.size:
            break
    return out


def _left(columns: FloatArray, y: FloatArray) -> float:
    """Sum of squares that least squares leave."""
    unit = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    return float(np.sum((y - unit @ np.linalg.lstsq(unit, y, rcond=1e-9)[0]) ** 2))
