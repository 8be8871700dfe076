"""Test and interval of the mean of few skewed numbers."""

from __future__ import annotations

import numpy as np
from scipy import stats

from sysid_ros.sample import FloatArray

_FLAT = 1e-6
"""Skewness below which the correction is none, and its inverse would divide by it."""


class SkewedMean:
    """The mean of n independent numbers whose distribution may lean to one side.

    With S = mean / s, s the standard deviation, and a the skewness, Hall's cubic ``S + a S^2 / 3 + a^2 S^3 / 27 + a / (6 n)`` has
    Student's distribution over sqrt(n) where S alone is as skewed as the numbers; it grows with S everywhere and can be inverted.
    P. Hall (1992), On the removal of skewness by transformation, J. R. Statist. Soc. B 54, section 2.

    Args:
        x: shape (n,), n >= 3, not all equal.
    """

    def __init__(self, x: FloatArray) -> None:
        self._n, self._mean, self._std = len(x), float(np.mean(x)), float(np.std(x, ddof=1))
        self._skewness = float(np.mean((x - self._mean) ** 3)) / float(np.std(x)) ** 3

    def by_chance(self) -> float:
        """Probability of such a mean, or a larger one, where the true one is zero."""
        s, a = self._mean / self._std, self._skewness
        straight = s + a * s**2 / 3.0 + a**2 * s**3 / 27.0 + a / (6.0 * self._n)
        return float(stats.t.sf(np.sqrt(self._n) * straight, self._n - 1))

    def interval(self, probability: float = 0.95) -> tuple[float, float]:
        """Of the true mean."""
        t = float(stats.t.ppf(0.5 + 0.5 * probability, self._n - 1)) / np.sqrt(self._n)
        return self._mean - self._std * self._skewed(t), self._mean - self._std * self._skewed(-t)

    def _skewed(self, straight: float) -> float:
        """The cubic's inverse."""
        a = self._skewness
        if abs(a) < _FLAT:
            return straight
        return float(3.0 / a * (np.cbrt(1.0 + a * (straight - a / (6.0 * self._n))) - 1.0))
