"""Recursive least squares whose forgetting keeps the information constant."""

from __future__ import annotations

import numpy as np

from sysid_ros.estimators import kernels
from sysid_ros.estimators.joseph_estimator import JosephEstimator
from sysid_ros.sample import FloatArray


class ConstantInformation(JosephEstimator):
    """``P <- P / lambda`` with ``lambda = 1 - nu' S^-1 nu / (m N0)``, ``S = Y P Y' + R``: as much is forgotten as a surprise
    tells (Fortescue, Kershenbaum, Ydstie 1981). ``N0`` is the number of updates in the forgetting time.

    What is never surprising is never forgotten; in directions that nothing excites the covariance grows with every surprise in
    others, but no further than the prior.
    """

    LEAST = 0.2
    """The least forgetting factor, whatever the surprise."""

    def _time_update(self, Y: FloatArray, innovation: FloatArray, variance: FloatArray) -> None:
        surprise = kernels.normalised_innovation(Y, self._P, variance, np.zeros(self.m), innovation)
        if not np.isfinite(surprise):
            return
        self._P /= max(1.0 - surprise * self.period / self.forgetting_time, self.LEAST)
        over = np.sqrt(np.maximum(self._P.diagonal() / self.prior_variance, 1.0))
        self._P /= np.outer(over, over)
