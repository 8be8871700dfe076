"""JosephEstimator: what estimators with a covariance share; they differ in how they forget."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from sysid_ros.estimators import kernels
from sysid_ros.estimators.combined import combine_in
from sysid_ros.estimators.estimator import Estimate, Estimator, Parts, Problem
from sysid_ros.sample import FloatArray

_NOT_FINITE = "the rows hold values that are not finite, or absurd"
_HELD = "nothing excites the parameters; the estimate is held"


class JosephEstimator(Estimator):
    """A time update that forgets, then the measurement update in Joseph form, row by row, with errors considered.

    Args:
        prior_std: standard deviation of each parameter at the start, shape (p,). variance: noise of each row, shape (m,).
        period: time between updates [s]. forgetting_time: time constant of what is forgotten [s].
        block: the parameters that :meth:`forget` forgets; all if not given.
    """

    def __init__(
        self,
        prior_std: FloatArray,
        variance: FloatArray,
        period: float = 0.01,
        forgetting_time: float = math.inf,
        block: slice | None = None,
    ) -> None:
        super().__init__(len(prior_std), len(variance))
        self.prior_variance = np.asarray(prior_std, dtype=float) ** 2
        self.variance = np.asarray(variance, dtype=float)
        self.period, self.forgetting_time = period, forgetting_time
        self._block = slice(0, self.p) if block is None else block
        self.reset()

    @classmethod
    def of(cls, problem: Problem) -> JosephEstimator:
        return cls(problem.prior_std, problem.floor, problem.period, problem.forgetting_time, problem.jump.block)

    def reset(self) -> None:
        self._theta = np.zeros(self.p)
        self._P = np.diag(self.prior_variance)
        self._sensitivity = np.zeros((self.p, 0))

    def forget(self) -> None:
        block = self._block
        self._theta[block] = 0.0
        self._P[block, :] = 0.0
        self._P[:, block] = 0.0
        self._P[block, block] = np.diag(self.prior_variance[block])

    def combine(self, where: slice, other: Parts) -> None:
        combine_in(self._theta, self._P, self._sensitivity, where, other)

    @abstractmethod
    def _time_update(self, Y: FloatArray, innovation: FloatArray, variance: FloatArray) -> None:
        """Let ``_P`` forget, before rows Y (m, p) of this innovation and noise (m,) are taken in."""

    def update(
        self,
        Y: FloatArray,
        tau: FloatArray,
        hold: bool = False,
        extra_variance: FloatArray | None = None,
        considered: FloatArray | None = None,
    ) -> Estimate:
        innovation = np.empty(self.m)
        if not kernels.innovate(Y, tau, self._theta, innovation):
            return self._estimate(innovation, "not_finite", _NOT_FINITE)
        if hold:
            return self._estimate(innovation, "not_excited", _HELD)
        variance = self.variance if extra_variance is None else self.variance + extra_variance
        Z = self._fit_considered(considered)
        self._time_update(Y, innovation, variance)
        kernels.joseph_update_considering(self._theta, self._P, Y, tau, variance, self._sensitivity, Z)
        return self._estimate(innovation, "ok", "")
