"""State of a bristle that bends before it slides: what dry friction remembers of a motion (Dahl 1968)."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_BEFORE = 0.3
"""Time before the first position in which a joint moved as it does after it [s]: what moves then has moved before, and what
stands has nothing that is known."""


def bristle(q: FloatArray, z_s: float, period: float) -> FloatArray:
    """z / z_s along positions, shape (N, n), by the exact solution of each step: ``z = s z_s + (z0 - s z_s) exp(-|dq| / z_s)``.

    Args:
        q: positions [rad], shape (N, n). z_s: displacement over which it bends [rad]. period: of the positions [s].
    """
    return np.asarray(_bent(q, z_s, min(round(_BEFORE / period), len(q) - 1)))


@njit(cache=True)  # type: ignore[untyped-decorator]
def _bent(q: FloatArray, z_s: float, before: int) -> FloatArray:
    out = np.zeros_like(q)
    for j in range(q.shape[1]):
        z = 0.0
        for i in range(before, 0, -1):
            step = q[i, j] - q[i - 1, j]
            s = np.sign(step)
            z = s + (z - s) * np.exp(-abs(step) / z_s)
        out[0, j] = z
        for i in range(1, q.shape[0]):
            step = q[i, j] - q[i - 1, j]
            s = np.sign(step)
            z = s + (z - s) * np.exp(-abs(step) / z_s)
            out[i, j] = z
    return out
