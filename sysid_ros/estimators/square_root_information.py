"""Recursive least squares in square-root information form."""

from __future__ import annotations

import math

import numpy as np
from scipy import linalg

from sysid_ros.estimators import kernels
from sysid_ros.estimators.estimator import Estimate, Estimator, Problem
from sysid_ros.sample import FloatArray

_NOT_FINITE = "the rows hold values that are not finite, or absurd"
_HELD = "nothing excites the parameters; the estimate is held"


class SquareRootInformation(Estimator):
    """``R theta = z`` with R upper triangular and ``R' R`` the information: new rows are folded in by an orthogonal
    transformation (Bierman 1977, chapter V), so that the information is never negative, whatever the rounding. Forgetting towards
    the prior by lambda an update, as in exponential resetting.

    Errors that are considered are more right sides, of which the solutions are what they do to theta.

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
        self._std, self.variance = np.asarray(prior_std, dtype=float), np.asarray(variance, dtype=float)
        self.forgetting_factor = math.exp(-period / forgetting_time)
        self._block = slice(0, self.p) if block is None else block
        self.reset()

    @classmethod
    def of(cls, problem: Problem) -> SquareRootInformation:
        return cls(problem.prior_std, problem.floor, problem.period, problem.forgetting_time, problem.jump.block)

    def reset(self) -> None:
        self._R = np.eye(self.p)  # of theta over its prior standard deviation
        self._theta = np.zeros(self.p)
        self._sensitivity = np.zeros((self.p, 0))
        self._take_covariance()

    def _solve(self, right: FloatArray) -> FloatArray:
        """Parameters from a right side (p,) or (p, c): by LAPACK itself, as what SciPy does around it takes ten times as long."""
        std = self._std if right.ndim == 1 else self._std[:, None]
        if not right.size:
            return np.zeros(right.shape)
        if not (np.isfinite(self._R).all() and np.isfinite(right).all()):
            raise ValueError("the information is not finite")
        solved, singular = linalg.lapack.dtrtrs(self._R, right)
        if singular:
            raise np.linalg.LinAlgError(f"the information tells nothing of parameter {singular - 1}")
        return np.asarray(solved * std)

    def _take_covariance(self) -> None:
        inverse = self._solve(np.eye(self.p))
        self._P = inverse @ inverse.T

    def shift(self, where: slice, by: FloatArray) -> None:
        self._theta[where] += by

    def forget(self) -> None:
        block, kept = self._block, np.ones(self.p, dtype=bool)
        kept[block] = False
        P = np.zeros((self.p, self.p))
        P[np.ix_(kept, kept)] = self._P[np.ix_(kept, kept)] / np.outer(self._std[kept], self._std[kept])
        P[block, block] = np.eye(self.p)[block, block]
        self._theta[block] = 0.0
        self._R = np.ascontiguousarray(np.linalg.cholesky(np.linalg.inv(P)).T)
        self._take_covariance()

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
        used = np.isfinite(variance)
        Z = self._fit_considered(considered)
        weight = 1.0 / np.sqrt(variance[used])[:, None]
        # the unknown is the change of theta, over the prior's std; forgetting exchanges information for the prior's
        keep, S, before = self.forgetting_factor, self._sensitivity, 2 * self.p if self.forgetting_factor < 1.0 else self.p
        rows = [math.sqrt(keep) * self._R, math.sqrt(1.0 - keep) * np.eye(self.p)][: before // self.p]
        Q, self._R = np.linalg.qr(np.vstack([*rows, weight * Y[used] * self._std]))
        own = Q[before:].T  # what was known before has a right side of zero
        self._theta = self._theta + self._solve(own @ (weight[:, 0] * innovation[used]))
        self._sensitivity = S - self._solve(own @ (weight * (Z[used] + Y[used] @ S)))
        self._take_covariance()
        return self._estimate(innovation, "ok", "")
