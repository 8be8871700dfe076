"""A Kalman filter whose parameters walk at random."""

from __future__ import annotations

import numpy as np

from sysid_ros.estimators.joseph_estimator import JosephEstimator
from sysid_ros.sample import FloatArray


class KalmanRandomWalk(JosephEstimator):
    """``theta <- theta + w``, ``w ~ N(0, Q)`` with ``Q = P0 period / forgetting_time``: what is not seen is as unknown as before
    any data after the forgetting time (Kalman 1960; on a quadruped's payload Haack et al. 2025). Variances stay below the
    prior's.
    """

    def _time_update(self, Y: FloatArray, innovation: FloatArray, variance: FloatArray) -> None:
        room = np.maximum(self.prior_variance - self._P.diagonal(), 0.0)
        step = self.prior_variance * (self.period / self.forgetting_time)
        self._P[np.diag_indices(self.p)] += np.minimum(step, room)
