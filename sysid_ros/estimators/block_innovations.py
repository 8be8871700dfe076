"""BlockInnovations: sums of innovations over blocks of several lengths, free of what the fit takes out of residuals."""

from __future__ import annotations

import numpy as np

from sysid_ros.estimators import variable_update
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

    Attributes:
        total, starts, known, progress: what :func:`variable_update.add_to_blocks` adds to.
    """

    def __init__(self, lengths: FloatArray, m: int, p: int) -> None:
        levels = len(lengths)
        self.progress = np.zeros((2, levels))
        self.progress[variable_update.LENGTH] = lengths
        self.total = np.zeros((m, p + 1))
        self.starts = np.zeros((levels, m, p + 1))
        self.known = np.zeros((levels, p, p + 1))

    def interrupt(self) -> None:
        """Drop the blocks in progress."""
        self.progress[variable_update.FILLED] = 0.0

    def pop_full(self, variance: FloatArray) -> list[tuple[int, FloatArray]]:
        """The level of each block that is full, and its estimate of the noise, shape (m,); they begin anew.

        Args:
            variance: noise of the rows as it is known, shape (m,).
        """
        filled, lengths = self.progress
        full = []
        for level in np.flatnonzero(filled >= lengths):
            filled[level] = 0.0
            sums, known = self.total - self.starts[level], self.known[level]
            Ysum, P = sums[:, :-1], known[:, :-1]
            innovation = sums[:, -1] - Ysum @ known[:, -1]
            leverage = ((Ysum @ P) * Ysum).sum(axis=1) / (lengths[level] * variance)
            if float(leverage.max()) < _MOST_LEVERAGE:
                full.append((int(level), innovation**2 / lengths[level] / (1.0 + leverage)))
        return full
