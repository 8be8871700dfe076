"""BlockInnovations: sums of innovations over blocks of several lengths, free of what the fit takes out of residuals."""

from __future__ import annotations

import numpy as np

from sysid_ros.sample import FloatArray

_MOST_LEVERAGE = 3.0
"""A block that the prior or a fresh jump makes more uncertain than this says little of the noise."""


class BlockInnovations:
    """``u = sum_k (tau_k - Y_k theta_0)`` over a block of N rows, theta_0 from before it, has the variance
    ``N r + Ysum P_0 Ysum'``, so that ``u^2 / N / (1 + Ysum P_0 Ysum' / (N r))`` has the mean r.

    Residuals of a fit that follows slow noise are smaller than the noise, the more so the longer the block; innovations over a
    whole block are not (recursive residuals: Brown, Durbin, Evans 1975).

    Args:
        lengths: rows a block, a level, shape (levels,). m: rows of an update. p: parameters.
    """

    def __init__(self, lengths: FloatArray, m: int, p: int) -> None:
        levels = len(lengths)
        self._lengths = lengths
        self._filled = np.zeros(levels)
        self._Y = np.zeros((levels, m, p))
        self._tau = np.zeros((levels, m))
        self._theta = np.zeros((levels, p))
        self._P = np.zeros((levels, p, p))

    def interrupt(self) -> None:
        """Drop the blocks in progress."""
        self._filled[:] = 0.0

    def add(
        self, Y: FloatArray, tau: FloatArray, theta: FloatArray, P: FloatArray, variance: FloatArray
    ) -> list[tuple[int, FloatArray]]:
        """Take in rows (m, p), (m,) with what was known before them, (p,) and (p, p), and their noise (m,).

        Returns the level of each block that is full now and its estimate of the noise, shape (m,).
        """
        for level in np.flatnonzero(self._filled == 0.0):
            self._theta[level], self._P[level] = theta, P
            self._Y[level] = 0.0
            self._tau[level] = 0.0
        self._Y += Y
        self._tau += tau
        self._filled += 1.0
        full = []
        for level in np.flatnonzero(self._filled >= self._lengths):
            self._filled[level] = 0.0
            length = self._lengths[level]
            Ysum = self._Y[level]
            innovation = self._tau[level] - Ysum @ self._theta[level]
            leverage = ((Ysum @ self._P[level]) * Ysum).sum(axis=1) / (length * variance)
            if float(leverage.max()) < _MOST_LEVERAGE:
                full.append((int(level), innovation**2 / length / (1.0 + leverage)))
        return full
