"""Recursive least squares whose forgetting follows the innovations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.estimators import kernels
from sysid_ros.estimators.block_innovations import BlockInnovations
from sysid_ros.estimators.estimator import Estimate, Estimator
from sysid_ros.estimators.noise import LongRunVariance
from sysid_ros.estimators.normal_equations import NormalEquations
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class JumpRule:
    """Which parameters may jump, and what counts as a jump.

    Attributes:
        block: the parameters that may jump.
        least: change of the block's parameters of which one must be exceeded, shape (size of block,); infinite where it does
            not count.
        memory: time after a jump during which old data are still in the rows [s].
    """

    block: slice
    least: FloatArray
    memory: float


class VariableForgetting(Estimator):
    """Joseph-form recursive least squares that remembers while the innovations fit and forgets when they do not.

    - Time update: exponential resetting towards the prior (Salgado, Goodwin, Middleton 1988), which bounds P by P0 in every
    direction, only
      while something excites the parameters.
    - Measurement update: Joseph form, row by row, with the long-run variance of the residuals as noise
    (:class:`LongRunVariance`).
    - Change: a run of innovations too large for ``Y P Y' + Rd`` is fitted with a jump of the block that may jump (Willsky,
    Jones 1976); if
      the jump explains it, that block's covariance goes back to the prior, and once more when the old data have left the filters.
    - Outlier: an innovation too large that no jump explains gets less weight.

    Args:
        prior_std: standard deviation of each parameter before any data, shape (p,).
        floor: least variance of a row, shape (m,).
        period: time between updates [s].
        forgetting_time: time constant of the resetting [s].
        jump: which parameters may jump.
    """

    THRESHOLD = 4.0
    HITS = 5
    EXPLAINED = 0.8
    SIGNIFICANT = 25.0
    FORGET_EVERY = 10
    INDEPENDENT = 0.1
    """Time after which a coloured residual counts as a new one, in the first rows [s]."""

    def __init__(self, prior_std: FloatArray, floor: FloatArray, period: float, forgetting_time: float, jump: JumpRule) -> None:
        self.p, self.m = len(prior_std), len(floor)
        self._prior_variance = np.asarray(prior_std, dtype=float) ** 2
        self._floor = np.asarray(floor, dtype=float)
        self._period = period
        self._epsilon = min(self.FORGET_EVERY * period / forgetting_time, 0.5)
        self._jump = jump
        self._work = np.zeros((self.p, self.p))
        self.reset()

    def reset(self) -> None:
        self._theta = np.zeros(self.p)
        self._P = np.diag(self._prior_variance)
        self._sensitivity = np.zeros((self.p, 0))
        self.noise = LongRunVariance(self.m, self._period, self._floor)
        self._spread: FloatArray = self._floor * self.noise.CAUTION
        self._spread_count = 0
        self._updates = 0
        self._blocks = BlockInnovations(self.noise.lengths, self.m, self.p)
        self._equations = NormalEquations(self._prior_variance, self.m)
        self._settling = 0
        self._burst = 0
        self._early: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        self._early_jump = False
        self.jumps = 0
        self.last_jump: FloatArray = np.zeros(len(range(*self._jump.block.indices(self.p))))
        self.z = 0.0
        self._clear_hits()

    @property
    def prior_variance(self) -> FloatArray:
        """Diagonal of the covariance before any data, which bounds it at all times, shape (p,)."""
        return self._prior_variance

    @property
    def theta(self) -> FloatArray:
        return self._theta.copy()

    @property
    def row_variance(self) -> FloatArray:
        """Variance of the residual of single rows, shape (m,): without what follows from their colour."""
        return self._spread

    @property
    def settling(self) -> bool:
        """True while data from before a jump are still in the rows."""
        return self._settling > 0

    def update(
        self,
        Y: FloatArray,
        tau: FloatArray,
        hold: bool = False,
        extra_variance: FloatArray | None = None,
        considered: FloatArray | None = None,
    ) -> Estimate:
        innovation = tau - Y @ self._theta
        if not self.usable(Y, tau):
            return self._estimate(innovation, "not_finite", "the rows hold values that are not finite, or absurd")
        extra = np.zeros(self.m) if extra_variance is None else extra_variance
        spread = self._spread + extra
        self.z = z = kernels.normalised_innovation(Y, self._P, spread, innovation)
        jumped = self._watch(Y, innovation, spread, extra, z)
        if jumped and hold:
            self._burst = round(0.5 / self._period)
        if hold and self._burst == 0:
            self._interrupt_noise()
            return self._held(innovation)
        self._burst = max(self._burst - 1, 0)
        known = self.noise.known
        variance = (self.noise.variance if known else self._floor) + extra
        outlier = z > self.THRESHOLD and not self.settling
        if outlier:
            variance = variance * z
        Z = self._fit_sensitivity(considered)
        self._forget()
        noise_is_new = known and not outlier and self._learn_colour(Y, tau, extra)
        kernels.joseph_update_considering(self._theta, self._P, Y, tau, variance, self._sensitivity, Z)
        self._equations.add(Y, tau, Z, (self.noise.variance if known else self._floor) / variance)
        self._updates += 1
        self._settle()
        if known:
            self._learn_noise(tau - Y @ self._theta, extra, learn_colour=False)
            if noise_is_new:
                self._weigh_anew()
        elif not self.settling:
            self._early.append((Y, tau, extra))
            self._learn_early()
        if not np.isfinite(self._theta).all():
            self.reset()
            return self._estimate(innovation, "not_finite", "the recursion broke down and started again")
        if outlier:
            return self._estimate(innovation, "outlier", "the torques do not fit the estimate; they were given less weight")
        if not self.noise.known:
            return self._estimate(innovation, "warming_up", "the noise of the torques is not known yet")
        if self.settling:
            return self._estimate(innovation, "warming_up", "the parameters have just jumped")
        return self._estimate(innovation, "ok", "")

    def covariance(self) -> FloatArray:
        """Covariance of theta, shape (p, p), with what the considered errors do to it."""
        return self._P + self._sensitivity @ self._sensitivity.T

    def _weigh_anew(self) -> None:
        """Rows were weighted with the noise known when they came; weight them all with what is known now."""
        self._theta, self._P, self._sensitivity = self._equations.solve(self.noise.variance)

    def _learn_early(self) -> None:
        """The first residuals say nothing while the fit still follows every row: the noise is read from one fit to all first
        rows.

        They were weighted with the least noise; once it is known they are taken in again with what it is.
        """
        count, fewest = len(self._early), self.noise.fewest_updates
        if count not in (fewest // 2, fewest):
            return
        self._spread_count = 0
        freedom = max(1.0 - self.p / (self.m * count * self._period / self.INDEPENDENT), 0.25)
        for Y, tau, extra in self._early:
            self._learn_noise((tau - Y @ self._theta) / np.sqrt(freedom), extra, learn_colour=count == fewest)
        if count == fewest:
            self._early = []
            self._weigh_anew()

    def _held(self, innovation: FloatArray) -> Estimate:
        return self._estimate(innovation, "not_excited", "nothing excites the parameters; the estimate is held")

    def _estimate(self, innovation: FloatArray, status: str, reason: str) -> Estimate:
        return Estimate(self._theta.copy(), self.covariance(), innovation, status, reason)

    def _forget(self) -> None:
        if self._updates % self.FORGET_EVERY == 0 and not self.settling:
            kernels.forget_towards_prior(self._P, self._prior_variance, self._epsilon, self._work)
            self._equations.forget(self._epsilon, self._theta, self._sensitivity)

    def _watch(self, Y: FloatArray, innovation: FloatArray, spread: FloatArray, extra: FloatArray, z: float) -> bool:
        """Collect innovations that are too large; True where a jump explains them."""
        if self.settling or self._spread_count == 0 or (self._early_jump and not self.noise.known):
            return False
        if not z > self.THRESHOLD:
            self._hits -= 1
            if self._hits <= 0:
                self._clear_hits()
            return False
        self._hits += 1
        block = Y[:, self._jump.block]
        weighted = block / spread[:, None]
        self._information += weighted.T @ block
        self._coloured_information += (block / (self._coloured_variance() + extra)[:, None]).T @ block
        self._score += weighted.T @ innovation
        self._statistic += float(innovation @ (innovation / spread))
        if self._hits < self.HITS:
            return False
        prior = np.diag(1.0 / self._prior_variance[self._jump.block])
        change = np.linalg.solve(self._information + prior, self._score)
        explained = float(change @ self._score) / self._statistic
        significance = float(change @ self._coloured_information @ change)
        self._clear_hits()
        if explained < self.EXPLAINED or significance < self.SIGNIFICANT or not np.any(np.abs(change) > self._jump.least):
            return False
        self.jumps += 1
        self.last_jump = np.asarray(change)
        self._settling = max(round(self._jump.memory / self._period), 1)
        self._interrupt_noise()
        if self.noise.known:
            self._reset_block()
        else:
            self._start_again()
        return True

    def _coloured_variance(self) -> FloatArray:
        """Long-run variance of the rows; while it is not known, as if what is left kept its value for a block, shape (m,)."""
        if self.noise.known:
            return self.noise.variance
        return np.maximum(self.noise.variance, self._spread * self.noise.BLOCKS[0] / self._period)

    def _clear_hits(self) -> None:
        size = len(range(*self._jump.block.indices(self.p)))
        self._hits = 0
        self._information = np.zeros((size, size))
        self._coloured_information = np.zeros((size, size))
        self._score = np.zeros(size)
        self._statistic = 0.0

    def _reset_block(self) -> None:
        """Start the block that jumped again; the others start from what they are known to now."""
        block = self._jump.block
        self._P[block, :] = 0.0
        self._P[:, block] = 0.0
        self._P[block, block] = np.diag(self._prior_variance[block])
        self._equations.start(self._P, self._theta, self._sensitivity)

    def _start_again(self) -> None:
        """Before the noise is known nothing learned is worth keeping through a jump."""
        self._theta = np.zeros(self.p)
        self._P = np.diag(self._prior_variance)
        self._sensitivity[:] = 0.0
        self._equations.start(self._P, self._theta, self._sensitivity)
        self._early = []
        self._early_jump = True

    def _settle(self) -> None:
        if self._settling > 0:
            self._settling -= 1
            if self._settling == 0 and self.noise.known:
                self._reset_block()
            elif self._settling == 0:
                self._start_again()

    def _learn_colour(self, Y: FloatArray, tau: FloatArray, extra: FloatArray) -> bool:
        """Take rows into the blocks that the long-run variance is read from; True where it is known otherwise than before."""
        if self.settling:
            return False
        weight = np.sqrt(self._spread / (self._spread + extra))
        full = self._blocks.add(weight[:, None] * Y, weight * tau, self._theta, self._P, self.noise.variance)
        known_anew = False
        for level, power in reversed(full):
            known_anew = self.noise.add_block(level, power)
        return known_anew

    def _interrupt_noise(self) -> None:
        """Residuals to come do not follow the ones before."""
        self.noise.interrupt()
        self._blocks.interrupt()

    def _learn_noise(self, residual: FloatArray, extra: FloatArray, learn_colour: bool) -> None:
        if self.settling:
            self._interrupt_noise()
            return
        weighted: FloatArray = residual * np.sqrt(self._spread / (self._spread + extra))
        squared: FloatArray = weighted * weighted
        if self._spread_count * self._period > 0.5:
            np.minimum(squared, 9.0 * self._spread, out=squared)
        self._spread_count += 1
        rate = max(1.0 / self._spread_count, self._period / 10.0)
        self._spread = np.maximum((1.0 - rate) * self._spread + rate * squared, self._floor)
        if learn_colour:
            self.noise.add(weighted)
