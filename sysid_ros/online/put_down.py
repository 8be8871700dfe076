"""PutDown: whether what is carried is there no more, where no single row shows it."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_SELDOM = 600.0
"""Something is put down once in this time, before any data [s]."""


class PutDown:
    """Page's test (1954) of what is known against the one change that is known beforehand: nothing is carried.

    A search for any payload pays for each of the ten parameters that it fits, and needs rows that are far off. That a known
    payload is gone has nothing to fit: row by row the logarithm of how much likelier it is,

        l = sum_j ((y - Y theta)_j^2 - (y - Y theta + Y_p (theta_p - empty))_j^2) / (2 R_j),

    with the variance R by which rows of coloured noise add up, makes ``S <- max(S + l, 0)``. S above ``h`` is expected
    once in ``exp(h)`` rows at most where nothing has changed (Lorden 1971), and no test with as few false alarms is faster in the
    worst case (Moustakides 1986).
    """

    def __init__(self) -> None:
        self._sum = 0.0

    def restart(self) -> None:
        """Rows to come are told from what is known then."""
        self._sum = 0.0

    def found(
        self,
        rows: tuple[FloatArray, FloatArray],
        theta: FloatArray,
        empty: FloatArray,
        noise: tuple[FloatArray, FloatArray],
        hidden: FloatArray,
        period: float,
    ) -> bool:
        """Whether, with the rows Y (m, p), y (m,), it has become likelier than not that what is carried was put down.

        Args:
            theta: parameters as they are known, the payload's first, shape (p,). empty: those that count as nothing, shape (10,).
            noise: over a long run, and of single rows as if they were white, shape (m,) each; noise that is small over a long run
                only cancels there. hidden: variance of what dry friction hides in the mean of many rows, for one of them, shape
                (m,). period: between rows [s].
        """
        variance = np.maximum(*noise) + hidden
        self._sum = max(self._sum + _likelier(*rows, theta, empty, variance), 0.0)
        return self._sum > math.log(_SELDOM / period)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _likelier(Y: FloatArray, y: FloatArray, theta: FloatArray, empty: FloatArray, variance: FloatArray) -> float:
    """Logarithm of how much likelier rows are with the payload ``empty`` than with that in theta."""
    out = 0.0
    for i in range(y.size):
        left, gone = y[i], 0.0
        for a in range(theta.size):
            left -= Y[i, a] * theta[a]
        for a in range(empty.size):
            gone += Y[i, a] * (theta[a] - empty[a])
        out -= gone * (left + 0.5 * gone) / variance[i]
    return out if np.isfinite(out) else 0.0
