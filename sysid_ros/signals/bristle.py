"""State of a bristle that bends before it slides: what dry friction remembers of a motion (Dahl 1968)."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray


@njit(cache=True)  # type: ignore[untyped-decorator]
def bristle(q: FloatArray, z_s: float) -> FloatArray:
    """z / z_s along positions, shape (N, n), by the exact solution of each step: ``z = s z_s + (z0 - s z_s) exp(-|dq| / z_s)``.

    Args:
        q: positions [rad], shape (N, n); at the first of them nothing is bent. z_s: displacement over which it bends [rad].
    """
    out = np.zeros_like(q)
    for j in range(q.shape[1]):
        z = 0.0
        for i in range(1, q.shape[0]):
            step = q[i, j] - q[i - 1, j]
            s = np.sign(step)
            z = s + (z - s) * np.exp(-abs(step) / z_s)
            out[i, j] = z
    return out
