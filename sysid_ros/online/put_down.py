"""Whether what is carried was put down, where no single row shows it: Page's test of the one change that is known beforehand.

A search for any payload pays for each of the ten parameters that it fits, and needs rows that are far off. That a known payload
is gone has nothing to fit: row by row the logarithm of how much likelier it is,

    l = sum_j ((y - Y theta)_j^2 - (y - Y theta + Y_p (theta_p - empty))_j^2) / (2 R_j),

with the variance R by which rows of coloured noise add up, makes ``S <- max(S + l, 0)`` (Page 1954). S above ``h`` is expected
once in ``exp(h)`` rows at most where nothing has changed (Lorden 1971), and no test with as few false alarms is faster in the
worst case (Moustakides 1986).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

SELDOM = 600.0
"""Something is put down once in this time, before any data [s]: with rows a period apart it is likelier than not from
``S = log(SELDOM / period)`` on."""


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def with_row(
    before: float,
    Y: FloatArray,
    y: FloatArray,
    theta: FloatArray,
    empty: FloatArray,
    run: FloatArray,
    single: FloatArray,
    passed: float,
    hidden: FloatArray,
    stays: float,
) -> float:
    """The sum S with the rows Y (m, p), y (m,).

    Args:
        before: S of the rows before. theta: parameters as they are known, the payload's first, shape (p,).
        empty: those that count as nothing, shape (10,).
        run, single: variance of noise over a long run, and of single rows, shape (m,) each. passed: part of white noise in these;
            as if it were white, because noise that is small over a long run only cancels there.
        hidden: variance of what dry friction hides of a row, shape (m,). stays: for how many rows it is the same.
    """
    out = 0.0
    for i in range(y.size):
        left, gone = y[i], 0.0
        for a in range(theta.size):
            left -= Y[i, a] * theta[a]
        for a in range(empty.size):
            gone += Y[i, a] * (theta[a] - empty[a])
        out -= gone * (left + 0.5 * gone) / (np.maximum(run[i], single[i] / passed) + stays * hidden[i])
    return max(before + out, 0.0) if np.isfinite(out) else before
