"""The covariance of all that is no change in a joint's series, and the trend that follows from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.fleet.changes.pooled import Pooled
from sysid_ros.fleet.changes.series import Series
from sysid_ros.sample import FloatArray

_FLOOR = 1e-6
"""Of a variance as a part of what is stated: two rows of one bag are not the same to the last digit."""


def covariance_of(series: Series, days: FloatArray, x: FloatArray, shared: Sequence[Pooled]) -> FloatArray:
    """Of the estimates of a joint minus what its kind expects, shape (N, P, N, P).

    Args:
        series: N bags. days: of them, shape (N,). x: covariates, shape (N, C). shared: of each parameter.
    """
    n, p = series.y.shape
    C = np.zeros((n, p, n, p))
    b = np.arange(n)
    C[b, :, b, :] = np.where(np.isfinite(series.covariance), series.covariance, 0.0)
    since = np.minimum.outer(days, days) - days[0]
    alike = x @ x.T
    for k, of in enumerate(shared):
        if not np.isfinite(of.spread):
            continue
        C[:, k, :, k] += of.spread + of.wander * since + of.deviation * alike
        C[b, k, b, k] += of.scatter + _FLOOR * np.nan_to_num(series.covariance[b, k, k])
    return C


def expected(x: FloatArray, shared: Sequence[Pooled]) -> FloatArray:
    """What the kind expects, shape (N, P)."""
    return np.column_stack([of.mean + x @ of.beta for of in shared])


def one_bag(series: Series, shared: Sequence[Pooled]) -> FloatArray:
    """Standard deviation of one bag's estimate beside the robot's level, shape (P,)."""
    stated = np.array([np.median(v[np.isfinite(v)]) if np.isfinite(v).any() else np.nan for v in _variances(series).T])
    return np.asarray(np.sqrt(np.where(np.isfinite(stated), stated, 1.0) + np.array([of.scatter for of in shared])))


def _variances(series: Series) -> FloatArray:
    k = np.arange(series.y.shape[1])
    return np.asarray(series.covariance[:, k, k])


def trend(
    y: FloatArray, variance: FloatArray, days: FloatArray, x: FloatArray, of: Pooled, course: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Level of one parameter at its bags, covariates and odd bags taken out, with changes, and its standard deviation, shape (N,)
    each: the smoothed state of the local-level model.

    Args:
        y: estimates, NaN where there is none. variance: that is stated. course: the expected course of the changes, shape (N,).
    """
    known = np.isfinite(y) & np.isfinite(variance)
    if not known.any() or not np.isfinite(of.spread):
        return np.full(len(y), np.nan), np.full(len(y), np.nan)
    level = of.spread + of.wander * (np.minimum.outer(days, days) - days[0])
    whole = level + of.deviation * (x @ x.T)
    total = whole[np.ix_(known, known)] + np.diag(variance[known] + of.scatter)
    gain = np.linalg.solve(total, level[known]).T
    left = (y - of.mean - x @ of.beta - course)[known]
    std = np.sqrt(np.maximum(np.diag(level) - np.einsum("ij,ji->i", gain, level[known]), 0.0))
    return of.mean + gain @ left + course, std
