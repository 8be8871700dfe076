"""LastingJumpSearch: a change of the parameters that lasts, told from disturbances that come and go, as impacts of feet."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from sysid_ros.estimators.jump_search import JumpRule
from sysid_ros.sample import FloatArray

_BLOCKS, _STARTS = 2, 4
"""Blocks that a change must explain, and beginnings of such a row of blocks during one of them."""
_TAILS = 4.0
"""Degrees of freedom of the blocks' distribution: between a Gaussian's and a Cauchy's tails, as impacts have them."""
_MEMORY = 40.0
"""Blocks after which what was learned of their noise has faded to a third."""
_SUPPOSED = 2.0
"""For so many blocks counts what is supposed of their noise: that rows of a block have it in common."""
_SELDOM = 600.0
"""A change is expected once in this time, before any data [s]."""
_DISTURBED = 8.0
"""A disturbance is so many times the noise. By the tails of both, one block alone is never as much likelier as the odds ask."""
_MOST = 9.0
"""A squared block counts as so many times its expectation at most in what is learned of the noise."""


@dataclass(slots=True)
class _Run:
    """Sums of the rows since a beginning, a block each, around what was known then."""

    theta: FloatArray
    P: FloatArray
    count: int = 0
    Y: list[FloatArray] = field(default_factory=list)
    tau: list[FloatArray] = field(default_factory=list)


class LastingJumpSearch:
    """Compares two explanations of the newest blocks of rows, each as long as a step of the robot: a jump of the parameters at
    their beginning, which then stays, or noise as it has been.

    Of a block, ``u = mean(tau - Y theta_0)`` with theta_0 from before the blocks has the covariance ``C = V + Ym P_0 Ym'``, where
    V is learned from blocks before, and a part rho of it is the same in the next block. It has heavy tails: a multivariate
    Student distribution of few degrees of freedom n, ``log p(u) = -(n + m)/2 log(1 + u' C^-1 u / n)``. A jump d makes it
    ``u - Ym d``; its evidence is the ratio of the likelihoods with the d that fits best, less what a prior of that width costs
    (Laplace; MacKay 2003, chapter 28), times the odds of a change at all (generalised likelihood ratio: Willsky, Jones 1976).

    One strong impact can't be a jump: a d that explains one block of two is contradicted by the other as much. Where no jump
    explains them, but a noise that is many times larger does, something acts on the robot that is neither.

    Args:
        rule: which parameters may jump, and what counts; ``lasts`` is the length of a block [s].
        prior_variance: of all parameters, shape (p,). m: rows of an update. period: between updates [s].

    Attributes:
        found_after: updates from a jump until it is found, at the usual place of it in the first block.
        disturbed: by the newest blocks, whether something acts that is neither noise as it has been nor a jump.
    """

    def __init__(self, rule: JumpRule, prior_variance: FloatArray, m: int, period: float) -> None:
        self._rule, self._m = rule, m
        self._prior = prior_variance[rule.block]
        self._every = max(round(rule.lasts / period / _STARTS), 1)
        self._length = _STARTS * self._every
        self._odds = float(np.log(_SELDOM / (self._every * period)))
        self.rows = _BLOCKS * self._length
        self.found_after = self.rows - self._every
        self._variance, self._product = np.zeros(m), np.zeros(m)
        self._weight = 0.0
        self._before: FloatArray | None = None
        self.disturbed = False
        self.restart()

    def restart(self) -> None:
        """Rows to come do not follow the ones before; what was learned of the noise stays."""
        self._runs: list[_Run] = []
        self._tick = 0
        self._before = None
        self.disturbed = False

    def add(self, Y: FloatArray, tau: FloatArray, theta: FloatArray, P: FloatArray, spread: FloatArray) -> FloatArray | None:
        """Take in the rows Y (m, p), tau (m,) of an update, before which theta (p,) and P (p, p) were known: the jump of the
        block that lasts, or None. ``spread``: variance of a single row, shape (m,)."""
        if self._tick % self._every == 0:
            self._runs.append(_Run(theta.copy(), P.copy()))
        self._tick += 1
        for run in self._runs:
            if run.count % self._length == 0:
                run.Y.append(np.zeros_like(Y))
                run.tau.append(np.zeros_like(tau))
            _add(Y, tau, run.Y[-1], run.tau[-1], 1.0 / self._length)
            run.count += 1
        if self._runs[0].count < self.rows:
            return None
        run = self._runs.pop(0)
        noise = (self._weight * self._variance + _SUPPOSED * spread) / (self._weight + _SUPPOSED)
        change = self._judge(run, noise)
        if change is None and (self._tick - self.rows) % self._length == 0:
            self._learn(run, noise)
        return change

    def _judge(self, run: _Run, noise: FloatArray) -> FloatArray | None:
        rho = np.clip(self._product / np.maximum(self._variance, 1e-300), 0.0, 0.9)
        u, W, covariance = [], [], []
        for Y, tau in zip(run.Y, run.tau, strict=True):
            u.append(tau - Y @ run.theta)
            W.append(Y[:, self._rule.block])
            covariance.append(np.diag(noise) + Y @ run.P @ Y.T)
        # the second block, less what of the first one's noise is still in it
        u[1], W[1] = u[1] - rho * u[0], W[1] - rho[:, None] * W[0]
        covariance[1] = covariance[1] * np.outer(np.sqrt(1.0 - rho**2), np.sqrt(1.0 - rho**2))
        inverse = [np.linalg.inv(c) for c in covariance]
        plain = [float(x @ i @ x) for x, i in zip(u, inverse, strict=True)]
        weights = [1.0] * _BLOCKS
        change: FloatArray = np.zeros(self._prior.size)
        for _ in range(4):  # the most likely jump under heavy tails: least squares that are weighted anew (Lange et al. 1989)
            parts = list(zip(W, inverse, weights, strict=True))
            information = sum((w * a.T @ i @ a for a, i, w in parts), np.diag(1.0 / self._prior))
            score = sum((w * a.T @ i @ x for (a, i, w), x in zip(parts, u, strict=True)), np.zeros(self._prior.size))
            change = np.asarray(np.linalg.solve(information, score))
            left = [float((x - a @ change) @ i @ (x - a @ change)) for x, a, i in zip(u, W, inverse, strict=True)]
            weights = [(_TAILS + self._m) / (_TAILS + x) for x in left]
        gained = (
            0.5
            * (_TAILS + self._m)
            * sum(np.log1p(before / _TAILS) - np.log1p(after / _TAILS) for before, after in zip(plain, left, strict=True))
        )
        scale = np.sqrt(self._prior)
        width = 0.5 * float(np.linalg.slogdet(information * np.outer(scale, scale))[1])
        cost = width + 0.5 * float(change @ (change / self._prior))
        found = gained - cost >= self._odds and bool(np.any(np.abs(change) > self._rule.least))
        self.disturbed = not found and self._is_disturbed(plain)
        return change if found else None

    def _is_disturbed(self, plain: list[float]) -> bool:
        """Whether squared blocks, over their covariances, are likelier where those are ``_DISTURBED`` squared times as large."""
        wide = _TAILS * _DISTURBED**2
        likelier = sum(0.5 * (_TAILS + self._m) * float(np.log1p(x / _TAILS) - np.log1p(x / wide)) for x in plain)
        return likelier - len(plain) * self._m * float(np.log(_DISTURBED)) > self._odds

    def _learn(self, run: _Run, noise: FloatArray) -> None:
        """What the first block of a row without a jump says of the noise."""
        u, Y = run.tau[0] - run.Y[0] @ run.theta, run.Y[0]
        known = ((Y @ run.P) * Y).sum(axis=1)
        share = noise / (noise + known)
        squared = np.minimum(u * u, _MOST * (noise + known)) * share
        self._weight = min(self._weight + 1.0, _MEMORY)
        self._variance += (squared - self._variance) / self._weight
        now = np.clip(u * np.sqrt(share), -3.0 * np.sqrt(noise), 3.0 * np.sqrt(noise))
        if self._before is not None:
            self._product += (self._before * now - self._product) / self._weight
        self._before = now


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _add(Y: FloatArray, tau: FloatArray, Y_sum: FloatArray, tau_sum: FloatArray, weight: float) -> None:
    for i in range(tau.size):
        tau_sum[i] += weight * tau[i]
        for a in range(Y.shape[1]):
            Y_sum[i, a] += weight * Y[i, a]
