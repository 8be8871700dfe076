"""WatchedEstimator: any estimator, with what its innovations tell of noise and jumps."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sysid_ros.estimators import kernels
from sysid_ros.estimators.estimator import Estimate, Estimator, Problem
from sysid_ros.estimators.jump_search import JumpSearch
from sysid_ros.estimators.long_run_variance import LongRunVariance
from sysid_ros.sample import FloatArray

_NOT_KNOWN = "the noise of the torques is not known yet"


class WatchedEstimator(Estimator):
    """Learns the noise of another estimator's rows and finds jumps of its parameters; needs nothing of it but its estimates.

    - Noise: the long-run variance of the innovations, each scaled to what it would be were theta known, ``nu / sqrt(1 + l)`` with
      ``l = diag(Y P Y') / r`` (recursive residuals: Brown, Durbin, Evans 1975). What it exceeds the floor by, which the other was
      told, is given to it as extra variance.
    - Jump: a run of innovations too large for ``Y P Y' + Rd`` that a jump of the block explains (:class:`.JumpSearch`). The
      other then forgets, and once more when the old data have left the filters.
    - Outlier: an innovation too large that no jump explains gets less weight.

    Args:
        inner: the other one. problem: that it was made for.
    """

    watches_itself: ClassVar[bool] = True
    found_after: ClassVar[int] = JumpSearch.HITS
    THRESHOLD = 4.0
    """Normalised innovation above which rows do not fit."""
    BURST = 0.5
    """Time for which rows are used after a jump although nothing excites the parameters [s]."""
    SPREAD_MEMORY = 10.0
    """Time constant of the mean of squared innovations [s]."""
    LEVERAGE = 0.5
    """Rows that the estimate makes more uncertain than so many times their noise say little of the noise."""

    def __init__(self, inner: Estimator, problem: Problem) -> None:
        super().__init__(inner.p, inner.m)
        self._inner, self._problem = inner, problem
        self._start()

    def _start(self) -> None:
        problem = self._problem
        self._noise = LongRunVariance(self.m, problem.period, problem.floor)
        self._spread = problem.floor * self._noise.CAUTION
        self._seen = self._settling = self._burst = 0
        self._search = JumpSearch(problem.jump, problem.prior_std**2)
        self.jumps, self.last_jump = 0, np.zeros(problem.jump.least.size)

    def reset(self) -> None:
        self._inner.reset()
        self._start()

    def forget(self) -> None:
        self._inner.forget()
        self._noise.interrupt()
        self._search = JumpSearch(self._problem.jump, self._problem.prior_std**2)

    @property
    def theta(self) -> FloatArray:
        return self._inner.theta

    def covariance(self) -> FloatArray:
        return self._inner.covariance()

    @property
    def noise_known(self) -> bool:
        return self._noise.known

    @property
    def noise_variance(self) -> FloatArray:
        return self._noise.variance

    @property
    def row_variance(self) -> FloatArray:
        return self._spread.copy()

    def update(
        self,
        Y: FloatArray,
        tau: FloatArray,
        hold: bool = False,
        extra_variance: FloatArray | None = None,
        considered: FloatArray | None = None,
    ) -> Estimate:
        extra = np.zeros(self.m) if extra_variance is None else extra_variance
        innovation = np.empty(self.m)
        if not kernels.innovate(Y, tau, self._inner.theta, innovation):
            return self._inner.update(Y, tau, hold, extra_variance, considered)
        P = self._inner.covariance()
        z = kernels.normalised_innovation(Y, P, self._spread, extra, innovation)
        if self._jumped(Y, innovation, extra, z) and hold:
            self._burst = round(self.BURST / self._problem.period)
        if hold and self._burst == 0:
            self._noise.interrupt()
            return self._inner.update(Y, tau, True, extra_variance, considered)
        self._burst = max(self._burst - 1, 0)
        outlier = z > self.THRESHOLD and self._settling == 0
        if not outlier and self._settling == 0:
            self._learn(np.einsum("ia,ab,ib->i", Y, P, Y), innovation, extra)
        variance = (self._noise.variance + extra) * (z if outlier else 1.0)
        estimate = self._inner.update(Y, tau, False, np.maximum(variance - self._problem.floor, 0.0), considered)
        return self._judged(estimate, outlier)

    def _judged(self, estimate: Estimate, outlier: bool) -> Estimate:
        """The inner estimate, doubted where noise or jumps give a reason to."""
        settling = self._settling > 0
        if settling:
            self._settling -= 1
            if self._settling == 0:
                self._inner.forget()
        if estimate.status != "ok":
            return estimate
        if outlier:
            return estimate._replace(status="outlier", reason="the torques do not fit the estimate; they were given less weight")
        if not self.noise_known:
            return estimate._replace(status="warming_up", reason=_NOT_KNOWN)
        return estimate._replace(status="warming_up", reason="the parameters have just jumped") if settling else estimate

    def _jumped(self, Y: FloatArray, innovation: FloatArray, extra: FloatArray, z: float) -> bool:
        """Collect innovations that are too large; True where a jump explains them, and the inner estimator has forgotten."""
        if self._settling > 0 or not self.noise_known:
            return False
        if not z > self.THRESHOLD:
            self._search.miss()
            return False
        change = self._search.hit(Y, innovation, self._spread + extra, self._noise.variance + extra)
        if change is None:
            return False
        self.jumps += 1
        self.last_jump = change
        self._settling = max(round(self._problem.jump.memory / self._problem.period), 1)
        self._noise.interrupt()
        self._inner.forget()
        return True

    def _learn(self, doubt: FloatArray, innovation: FloatArray, extra: FloatArray) -> None:
        """Take in what an innovation says of the noise, where theta is known well enough.

        Args:
            doubt: variance of the innovation that is due to theta, shape (m,). extra: of its noise, beside what is learned.
        """
        noise = self._noise.variance
        if float(np.max(doubt / (noise + extra))) > self.LEVERAGE:
            return
        # each row as if theta were known and there were no extra noise
        residual = innovation * np.sqrt(noise / (noise + extra + doubt))
        self._seen += 1
        rate = max(1.0 / self._seen, self._problem.period / self.SPREAD_MEMORY)
        self._spread += rate * (residual**2 - self._spread)
        np.maximum(self._spread, self._problem.part * self._problem.floor, out=self._spread)
        self._noise.add(residual)
