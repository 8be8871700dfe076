"""Residuals that are not white: how many independent rows they leave of the data, and a test of whether they are."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special

from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray

_LONGEST_GAP = 256
"""Rows left empty for a gap; what is longer decorrelates anyway."""


def root_of_covariance(prior: FloatArray, information: FloatArray) -> FloatArray:
    """R with ``R R' = (prior + information)^-1``, shape (p, p).

    Worked out in units of the prior, where a direction that the data do not show has the variance 1 and no other has more: what
    rounding leaves of parameters of many units can't make that negative, as it can in their own.

    Args:
        prior: inverse covariance before the data, positive definite. information: of the data.
    """
    own: FloatArray = np.linalg.inv(np.linalg.cholesky(prior))
    values, vectors = np.linalg.eigh(own @ information @ own.T)
    return np.asarray(own.T @ (vectors / np.sqrt(1.0 + np.maximum(values, 0.0))))


def coloured_information(
    bag: BagRows, residual: FloatArray, weight: FloatArray, root: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """``sum_j Cov(sum_t w_tj Y_tj e_tj)``, shape (p, p), and the mean noise variance of a row where it matters, shape (n,).

    For a residual with the spectrum S_j the covariance of the score is ``Z' S_j Z`` summed over frequencies, Z the transform of
    the weighted rows (the spectral form of the HAC covariance of Newey, West 1987). S_j is a flat-top lag-window estimate with a
    bandwidth that the correlation itself asks for (Politis 2003). A fit takes out of the residual what its parameters can follow,
    most where the motion has its power; each frequency is given back what the leverage there says that was taken.

    Args:
        bag: rows. residual: y - Y theta, shape (N, n) [N m]. weight: of each row, 0 where it is not used, shape (N, n).
        root: R, shape (p, p), with ``R R'`` the inverse of ``sum w Y' Y + prior``.
    """
    place = _places(bag)
    size = fft.next_fast_len(int(place[-1]) + 1 + _LONGEST_GAP, real=True)
    n, p = bag.y.shape[1], bag.Y.shape[2]
    total, level = np.zeros((p, p)), np.zeros(n)
    both_sides = np.full(size // 2 + 1, 2.0)
    both_sides[0] = 1.0
    if size % 2 == 0:
        both_sides[-1] = 1.0
    for j in range(n):
        w = weight[:, j]
        used = w > 0.0
        if used.sum() < TOL.fewest_rows:
            continue
        # The noise is that of sqrt(w) e: with the weights of a robust loss it is what is left of the outliers.
        scaled = np.sqrt(w)
        here = np.flatnonzero(bag.Y[:, j].any(axis=0))
        columns = np.zeros((size, len(here)))
        columns[place] = scaled[:, None] * bag.Y[:, j][:, here]
        noise = np.zeros(size)
        noise[place] = scaled * residual[:, j]
        Z = fft.rfft(columns, axis=0)
        del columns
        power = np.abs(fft.rfft(noise)) ** 2
        parts = np.ascontiguousarray(Z.real), np.ascontiguousarray(Z.imag)
        followed = np.sum([np.sum((part @ root[here]) ** 2, axis=1) for part in parts], axis=0)
        count = float(used.sum())
        spectrum = _smooth(power, count - followed, size, count)
        mass = both_sides * spectrum / size
        total[np.ix_(here, here)] += np.sum([(part * mass[:, None]).T @ part for part in parts], axis=0)
        # of the scaled rows, so w times the variance of a row
        level[j] = float(np.sum(both_sides * spectrum * followed) / max(np.sum(both_sides * followed), 1e-300)) / float(
            w[used].mean()
        )
    return total, level


def _places(bag: BagRows) -> NDArray[np.int64]:
    """Where each row stands on an even grid, gaps shortened."""
    steps = np.rint(np.diff(bag.t) / bag.period)
    steps = np.where(steps < 1.0, _LONGEST_GAP, np.clip(steps, 1, _LONGEST_GAP))
    return np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)


def on_grid(bag: BagRows, values: FloatArray) -> FloatArray:
    """Values of the rows, shape (N, c), on an even grid of times with NaN in the gaps."""
    place = _places(bag)
    out = np.full((int(place[-1]) + 1, values.shape[1]), np.nan)
    out[place] = values
    return out


def _smooth(power: FloatArray, left: FloatArray, size: int, count: float) -> FloatArray:
    """Noise variance a row at each frequency: smoothed power over smoothed degrees of freedom."""
    covariance = fft.irfft(power, size)
    window = _window(covariance[: size // 2] / max(covariance[0], 1e-300), count)
    lags = np.zeros(size)
    lags[: len(window)] = window
    lags[size - len(window) + 1 :] = window[:0:-1]
    smoothed = fft.rfft(covariance * lags).real
    freedom = fft.rfft(fft.irfft(left, size) * lags).real
    return np.asarray(np.maximum(smoothed, 0.0) / np.maximum(freedom, TOL.least_freedom * count))


def _window(correlation: FloatArray, count: float) -> FloatArray:
    """Trapezoid, 1 up to the lag after which the correlation is within its own noise, 0 from twice as far on."""
    calm = max(5, math.isqrt(int(math.log10(count) + 1)))
    level = 2.0 * math.sqrt(math.log10(max(count, 10.0)) / count)
    longest = max(int(min(count / 8, len(correlation) - calm - 2)), 1)
    quiet = np.abs(correlation[1 : longest + calm + 1]) < level
    runs = np.convolve(quiet, np.ones(calm), mode="valid") >= calm - 0.5
    flat = int(np.argmax(runs)) if runs.any() else longest
    flat = max(flat, 1)
    lag = np.arange(2 * flat + 1)
    return np.clip(2.0 - lag / flat, 0.0, 1.0)


def whiteness(residual: FloatArray, lags: int) -> tuple[float, float, float]:
    """Ljung-Box test (Ljung, Box 1978): Q, its p-value for ``lags`` degrees of freedom, and the correlation at lag one.

    Args:
        residual: shape (N,), rows evenly spaced; NaN where a row is not used.
    """
    here = np.isfinite(residual)
    x: FloatArray = np.where(here, residual, 0.0)
    x = np.where(here, x - x[here].mean(), 0.0) if here.any() else x
    count = int(here.sum())
    power = float(x @ x)
    if count <= lags + 2 or power <= 0.0:
        return math.nan, math.nan, math.nan
    statistic, first = 0.0, 0.0
    for k in range(1, lags + 1):
        pairs = int(np.sum(here[k:] & here[:-k]))
        if pairs < 2:
            continue
        correlation = float(x[k:] @ x[:-k]) / power * count / pairs
        first = correlation if k == 1 else first
        statistic += count * correlation**2 * pairs / count * (count + 2.0) / (count - k)
    return statistic, float(special.gammaincc(0.5 * lags, 0.5 * statistic)), first
