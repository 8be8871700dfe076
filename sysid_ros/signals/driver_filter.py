"""Low-passes of the first and the second order, as drivers have them."""

import numpy as np
from numba import njit
from scipy.linalg import expm

from sysid_ros.sample import FloatArray

ORDERS = (1, 2)
IS_A_DELAY = 0.03
"""Lag up to which one of the second order is a delay for all that efforts tell [s]: its cut-off is 8 Hz then. Below that it takes
less of an effort than the noise of accelerations does."""
_FORGOTTEN = 7.0
"""Lags after which 1e-3 is left of what was before."""


def driver_filter(values: FloatArray, steps: float, order: int = 1, axis: int = 0) -> FloatArray:
    """Values behind a Butterworth low-pass; exact for straight lines between them.

    What came before the first of them is taken for what follows it, mirrored in that point: a recording may begin in motion.

    Args:
        values: on an even grid along ``axis``. steps: spacing of the grid, in lags: the time by which what is slow comes late,
            ``lag dy/dt + y = x`` of order 1, ``lag^2 / 2 d2y/dt2 + lag dy/dt + y = x`` of order 2.
    """
    along = np.moveaxis(np.asarray(values, dtype=float), axis, 0)
    first = min(int(np.ceil(_FORGOTTEN / steps)), len(along) - 1)
    before = 2.0 * along[:1] - along[first:0:-1]
    flat = np.ascontiguousarray(np.concatenate([before, along]).reshape(first + len(along), -1))
    system = np.zeros((order + 2, order + 2))  # of y and its derivative, of x and its slope
    system[order, order + 1] = 1.0
    if order == 1:
        system[0, :2] = -1.0, 1.0
    else:
        system[0, 1], system[1, :3] = 1.0, (-2.0, -2.0, 2.0)
    passed = _driver_filter(flat, expm(steps * system)[:order], steps)[first:]
    return np.moveaxis(passed.reshape(along.shape), 0, axis)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _driver_filter(values: FloatArray, step: FloatArray, steps: float) -> FloatArray:
    order, out = len(step), values.copy()
    rate = np.zeros(values.shape[1])
    for k in range(1, len(values)):
        for j in range(values.shape[1]):
            y, before = out[k - 1, j], values[k - 1, j]
            slope = (values[k, j] - before) / steps
            if order == 1:
                out[k, j] = step[0, 0] * y + step[0, 1] * before + step[0, 2] * slope
            else:
                out[k, j] = step[0, 0] * y + step[0, 1] * rate[j] + step[0, 2] * before + step[0, 3] * slope
                rate[j] = step[1, 0] * y + step[1, 1] * rate[j] + step[1, 2] * before + step[1, 3] * slope
    return out
