"""Recursive least squares with a constant forgetting factor: the textbook's estimator, kept to compare with."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.estimators import kernels
from sysid_ros.estimators.estimator import Estimate, Estimator, Problem
from sysid_ros.sample import FloatArray

_NOT_FINITE = "the rows hold values that are not finite, or absurd"


class ConstantForgetting(Estimator):
    """``P <- P / lambda`` before each Joseph-form update (Ljung 1999, section 11.2); lambda = 1 is least squares with a prior.

    Its covariance grows without bound in directions that nothing excites.

    Args:
        prior_std: standard deviation of each parameter at the start, shape (p,).
        variance: noise of each row, shape (m,).
        forgetting_factor: lambda an update, 0 < lambda <= 1.
        prior_mean: shape (p,), 0 if not given.
    """

    def __init__(
        self, prior_std: FloatArray, variance: FloatArray, forgetting_factor: float = 1.0, prior_mean: FloatArray | None = None
    ) -> None:
        super().__init__(len(prior_std), len(variance))
        self.forgetting_factor = forgetting_factor
        self._prior_std = np.asarray(prior_std, dtype=float)
        self._prior_mean = np.zeros(self.p) if prior_mean is None else np.asarray(prior_mean, dtype=float)
        self.variance = np.asarray(variance, dtype=float)
        self.reset()

    @classmethod
    def of(cls, problem: Problem) -> ConstantForgetting:
        return cls(problem.prior_std, problem.floor, math.exp(-problem.period / problem.forgetting_time))

    def reset(self) -> None:
        self._theta = self._prior_mean.copy()
        self._P = np.diag(self._prior_std**2)
        self._sensitivity = np.zeros((self.p, 0))

    def update(
        self,
        Y: FloatArray,
        tau: FloatArray,
        hold: bool = False,
        extra_variance: FloatArray | None = None,
        considered: FloatArray | None = None,
    ) -> Estimate:
        innovation = np.empty(self.m)
        if hold:
            if kernels.innovate(Y, tau, self._theta, innovation):
                return self._estimate(innovation, "not_excited", "nothing excites the parameters; the estimate is held")
            return self._estimate(innovation, "not_finite", _NOT_FINITE)
        variance = self.variance if extra_variance is None else self.variance + extra_variance
        Z = self._fit_considered(considered)
        used = kernels.innovate_and_update(
            Y, tau, Z, variance, self._theta, self._P, self._sensitivity, innovation, self.forgetting_factor
        )
        return self._estimate(innovation, "ok", "") if used else self._estimate(innovation, "not_finite", _NOT_FINITE)
