"""Recursive least squares that forgets only where new rows tell something."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.estimators.joseph_estimator import JosephEstimator
from sysid_ros.sample import FloatArray


class DirectionalForgetting(JosephEstimator):
    """Forgetting in the subspace of the rows alone: SIFt-RLS (Lai, Bernstein 2024).

    With X the rows, whitened by their noise and scaled by the prior, without the singular directions that tell less than
    ``TELLS`` of a standard deviation, and the information ``L = P^-1``,

        P <- P + (1 - lambda) / lambda X' (X L X')^-1 X

    so that information is multiplied by lambda in the span of X and kept in all others. No direction winds up.
    """

    TELLS = 0.1

    def _time_update(self, Y: FloatArray, innovation: FloatArray, variance: FloatArray) -> None:
        factor = math.exp(-self.period / self.forgetting_time)
        if factor >= 1.0:
            return
        std = np.sqrt(self.prior_variance)
        _, size, directions = np.linalg.svd(Y / np.sqrt(variance)[:, None] * std, full_matrices=False)
        told = directions[size > self.TELLS] / std  # in units of the parameters, as covectors
        if not len(told):
            return
        scaled = told * self.prior_variance  # the same as directions of the parameters
        information = np.linalg.solve(self._P / np.outer(std, std), np.eye(self.p)) / np.outer(std, std)
        inner = scaled @ information @ scaled.T
        self._P += (1.0 - factor) / factor * scaled.T @ np.linalg.solve(inner, scaled)
        self._P = 0.5 * (self._P + self._P.T)
