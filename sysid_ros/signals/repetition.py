"""What a gait repeats: the period of its steps, and the power of an error that comes back at every one of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from sysid_ros.sample import FloatArray

STEP = (0.2, 2.0)
"""Periods of the gaits of robots on legs from a dog's size to a horse's [s]."""
_FINER = 4
"""Lags of a correlation between two samples: what is band-limited to their rate is known there, too."""
_CLOSE = 0.9
"""Of the lags at which steps nearly agree as well as at the best one the first is the period, the others are multiples."""
SURE = 3.0
"""Standard deviations of what correlations are by chance."""


def autocovariance(values: FloatArray, last: int, finer: int = 1) -> FloatArray:
    """Of each column of values (N, c) at lags 0 to ``last`` samples, ``finer`` lags a sample, shape (finer last + 1, c): the mean
    over the pairs that there are."""
    count = len(values)
    power = np.abs(np.fft.rfft(values, 2 * count, axis=0)) ** 2
    covariance = finer * np.fft.irfft(power, 2 * count * finer, axis=0)[: finer * last + 1]
    return np.asarray(covariance / (count - np.arange(finer * last + 1) / finer)[:, None])


def step_period(shapes: Sequence[FloatArray], period: float) -> float:
    """Time after which feet stand to one another as before [s]; 0 where they follow no beat.

    Args:
        shapes: of each stretch of a recording, lengths that change as feet are lifted, shape (N, m). period: of the samples [s].
    """
    longest = max((len(x) * period for x in shapes), default=0.0)
    last, first = round(min(STEP[1], longest / 3.0) / period), round(STEP[0] / period) * _FINER
    total, pairs = np.zeros(_FINER * max(last, 0) + 1), 0
    for x in shapes:
        if len(x) > last:
            each = x - ndimage.uniform_filter1d(x, max(1, round(STEP[1] / period)), axis=0)
            total += len(x) * autocovariance(each, last, _FINER).sum(axis=1)
            pairs += len(x)
    if len(total) <= first + 1 or total[0] <= 0.0:
        return 0.0
    correlation = total / total[0]
    begin = max(first, int(np.argmax(np.diff(correlation) > 0.0)))
    rest = correlation[begin:]
    if rest.max() < SURE / np.sqrt(pairs):
        return 0.0
    near = np.flatnonzero(rest >= _CLOSE * rest.max())
    hump = near[: int(np.argmax(np.diff(near, append=len(total) + 2) > 1)) + 1]  # the first one
    return (begin + int(hump[np.argmax(rest[hump])])) / _FINER * period


def repeated_power(values: Sequence[FloatArray], period: float, step: float) -> FloatArray:
    """Power of what comes back after every step, of each column, shape (c,).

    The mean of the autocovariance over all multiples of the step, which is free of bias and knows a power of a fiftieth of the
    noise after 25 steps; of a gait that wanders that over the first multiples, as far as it is beyond chance.

    Args:
        values: of each stretch of a recording, shape (N, c). period: of the samples [s]. step: of the gait [s].
    """
    width, most = values[0].shape[1], max(int(len(x) * period / step - 0.5) for x in values)
    if most < 1:
        return np.zeros(width)
    total, pairs, square = np.zeros((most, width)), np.zeros(most), np.zeros(width)
    for x in values:
        lags = np.arange(1, int(len(x) * period / step - 0.5) + 1)
        if len(lags):
            at = np.rint(lags * step / period * _FINER).astype(int)
            covariance = autocovariance(x, int(np.ceil(at[-1] / _FINER)), _FINER)
            count = len(x) - at / _FINER
            total[: len(lags)] += count[:, None] * covariance[at]
            pairs[: len(lags)] += count
        square += np.sum(x**2, axis=0)
    mean = np.cumsum(total, axis=0) / np.cumsum(pairs)[:, None]
    usual = square / sum(len(x) for x in values)
    surely = mean - SURE * usual / np.sqrt(np.cumsum(pairs))[:, None]
    return np.asarray(np.maximum(np.maximum(mean[-1], surely.max(axis=0)), 0.0))
