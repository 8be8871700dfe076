"""Recursive least squares whose forgetting follows the innovations."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from sysid_ros.estimators import kernels, variable_update
from sysid_ros.estimators.combined import combine_in
from sysid_ros.estimators.estimator import Estimate, Estimator, Noise, Parts, Problem
from sysid_ros.estimators.first_rows import learn_first
from sysid_ros.estimators.jump_search import JumpSearch
from sysid_ros.estimators.lasting_jump import LastingJumpSearch
from sysid_ros.estimators.long_run_variance import BlockInnovations, LongRunVariance
from sysid_ros.estimators.row_sums import RowSums
from sysid_ros.estimators.update_state import NOISE, SPREAD, UpdateState
from sysid_ros.estimators.variable_update import BLOCK_FULL, BROKEN_DOWN, NOT_ORDINARY, SAID, TAKEN_IN, take_in
from sysid_ros.sample import FloatArray


class VariableForgetting(Estimator):
    """Joseph-form recursive least squares that remembers while the innovations fit and forgets when they do not.

    - Measurement update: Joseph form, row by row, with the residuals' long-run variance as noise (:class:`LongRunVariance`).
    - Time update: exponential resetting towards the prior (Salgado, Goodwin, Middleton 1988), which bounds P by P0 in every
      direction, only while something excites the parameters.
    - Change: a run of innovations too large for ``Y P Y' + Rd`` is fitted with a jump of the block that may jump
      (:class:`JumpSearch`, :class:`LastingJumpSearch`); if the jump explains it, that block's covariance goes back to the prior,
      and once more when the old data have left the filters, which is the case after ``settling`` updates.
    - Outlier: an innovation too large that no jump explains gets less weight.

    Args:
        problem: what there is to estimate; forgotten is towards its prior.
    """

    watches_itself: ClassVar[bool] = True
    found_after: ClassVar[int] = JumpSearch.HITS
    THRESHOLD = 4.0
    FORGET_EVERY = 10
    SPREAD_ANEW, INDEPENDENT = 0.2, 0.1
    """What the mean of squared residuals counts for after a jump; after when a coloured residual is a new one at first [s]."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(len(problem.prior_std), len(problem.floor))
        self._prior_variance = np.asarray(problem.prior_std, dtype=float) ** 2
        self._floor = np.asarray(problem.floor, dtype=float)
        self._part, self._period, self._jump, self._colour = problem.part, problem.period, problem.jump, problem.extra_colour
        self._epsilon, self._no_extra = min(self.FORGET_EVERY * problem.period / problem.forgetting_time, 0.5), np.zeros(self.m)
        self.reset()

    def __setstate__(self, values: dict[str, Any]) -> None:
        self.__dict__.update(values)
        self._look_at(self._state)

    def _look_at(self, state: UpdateState) -> None:
        self._state, self._theta, self._P, self._sensitivity = state, state.theta, state.P, state.S

    @classmethod
    def of(cls, problem: Problem) -> VariableForgetting:
        return cls(problem)

    def reset(self) -> None:
        self.noise = LongRunVariance(self.m, self._period, self._floor)
        self._look_at(UpdateState(self.p, self.m, self.noise.lengths, self._period, self._colour))
        self._P[:] = np.diag(self._prior_variance)
        self._state.levels[:] = self._floor * self.noise.CAUTION, self._floor, self._part * self._floor
        self.row_variance = self._state.levels[SPREAD]
        self.noise_known, self.noise_variance = False, self.noise.variance
        self._spread_count = self._updates = self.settling = self._burst = self.jumps = self.misfits = self._taken = 0
        self._blocks = BlockInnovations(self._state)
        self._sums = RowSums(self._prior_variance, self._state)
        self._search = JumpSearch(self._jump, self._prior_variance)
        self._lasting = LastingJumpSearch(self._jump, self._prior_variance, self.m, self._period) if self._jump.lasts else None
        self.found_after = self._lasting.found_after if self._lasting else JumpSearch.HITS  # type: ignore[misc]
        self._early, self._early_jump = list[tuple[FloatArray, FloatArray, FloatArray]](), False
        self._kept: tuple[FloatArray, ...] = ()
        self.before_jump = self.last_jump = np.zeros(self._jump.least.size)

    def update(
        self,
        Y: FloatArray,
        tau: FloatArray,
        hold: bool = False,
        extra_variance: FloatArray | None = None,
        considered: FloatArray | None = None,
    ) -> Estimate:
        extra = self._no_extra if extra_variance is None else extra_variance
        Z = self._nothing_considered if considered is None else considered
        if Z.shape[1] != self._sensitivity.shape[1]:
            self._consider(Z.shape[1])
        innovation, done = np.empty(self.m), NOT_ORDINARY
        if self._lasting is not None:
            self._look_back(Y, tau, self._lasting)
        if not (hold or self.settling or self._burst or self._search.hits):
            count = self._spread_count if self.noise_known else -1
            done = take_in(Y, tau, extra, Z, self._state.memory, innovation, self.THRESHOLD, 1.0, count)
        if done != TAKEN_IN or count < 0:
            return self._with_care(Y, tau, hold, extra, Z, innovation, done)
        self._spread_count, self._taken, self._updates = self._spread_count + 1, self._taken + 1, self._updates + 1
        if self._updates % self.FORGET_EVERY == 0:
            self._forget_a_little()
        return Estimate(self._theta.copy(), innovation, "ok", "")

    def _with_care(
        self, Y: FloatArray, tau: FloatArray, hold: bool, extra: FloatArray, Z: FloatArray, innovation: FloatArray, done: int
    ) -> Estimate:
        """The rest of an update that is not one of many: ``done`` with it is what :func:`.take_in` says."""
        outlier, inflation = False, 1.0
        if done == NOT_ORDINARY and kernels.innovate(Y, tau, self._theta, innovation):
            z = kernels.normalised_innovation(Y, self._P, self._state.levels[SPREAD], extra, innovation)
            jumps = self.jumps
            if self._watch(Y, innovation, extra, z) and hold:
                self._burst = round(0.5 / self._period)
            if hold and self._burst == 0:
                self._interrupt_noise()
                return self._estimate(innovation, "not_excited", "nothing excites the parameters; the estimate is held")
            self._burst = max(self._burst - 1, 0)
            if self.jumps != jumps and self._jump.memory == 0.0:
                return self._estimate(innovation, "warming_up", SAID.jumped)
            outlier = z > self.THRESHOLD and not self.settling
            inflation = z if outlier else 1.0
            count = self._spread_count if self.noise_known and not self.settling else -1
            done = take_in(Y, tau, extra, Z, self._state.memory, innovation, np.inf, inflation, count)
        if done == BROKEN_DOWN:
            self.reset()
        if done not in (TAKEN_IN, BLOCK_FULL):
            return self._estimate(innovation, "not_finite", SAID.broken_down if done == BROKEN_DOWN else SAID.not_finite)
        self._spread_count += self.noise_known and not self.settling
        self._taken += inflation == 1.0
        if self.settling:
            self._settle()
        if not self.noise.known:
            self._learn_early(Y, tau, extra)
        elif done == BLOCK_FULL:
            self._learn_colour()
        self._updates += 1
        if self._updates % self.FORGET_EVERY == 0:
            self._forget_a_little()
        if outlier:
            return self._estimate(innovation, "outlier", "the torques do not fit the estimate; they were given less weight")
        if self.noise.known and not self.settling:
            return self._estimate(innovation, "ok", "")
        return self._estimate(innovation, "warming_up", SAID.jumped if self.noise.known else SAID.unknown_noise)

    def _forget_a_little(self) -> None:
        self.row_variance = self._state.levels[SPREAD]  # that of a deep copy is no view of its levels
        if self.noise.known and not self.settling:  # before, theta is that of rows weighed with the least noise: it is no centre
            self._sums.forget(self._epsilon, self.FORGET_EVERY)

    def compensate(self, noise: Noise, hold: bool, extra_variance: FloatArray | None) -> None:
        if noise is not None and self._taken > 0:
            level = self._state.levels[NOISE]
            variance = (level if extra_variance is None else level + self._colour * extra_variance) / self._taken
            known = self._prior_variance, self._theta, self._P, self._sensitivity
            variable_update.remove(*noise, variance, level, *known, self._state.rows)
            self._taken = 0

    def _consider(self, count: int) -> None:
        self._look_at(self._state.considering(count))
        self.row_variance, self._blocks.state = self._state.levels[SPREAD], self._state
        self._sums.consider(self._state)
        self._kept = ()

    def _weigh_anew(self) -> None:
        """Rows were weighted with the noise known when they came; weight them all with what is known now."""
        self.noise_known, self.noise_variance = self.noise.known, self.noise.variance
        self._state.levels[NOISE] = self.noise.variance
        self._theta[:], self._P[:], self._sensitivity[:] = self._sums.solve(self.noise.variance)

    def _learn_colour(self) -> None:
        """Read the long-run variance from the blocks that are full."""
        known_anew = [self.noise.add_block(*block) for block in reversed(self._blocks.pop_full(self.noise.variance))]
        if known_anew and known_anew[-1]:
            self._weigh_anew()

    def _learn_early(self, Y: FloatArray, tau: FloatArray, extra: FloatArray) -> None:
        """The first residuals say nothing while the fit still follows every row: the noise is read from one fit to all first
        rows. They were weighted with the least noise; once it is known they are taken in again with what it is."""
        if self.settling:
            return
        self._early.append((Y, tau, extra))
        count, fewest = len(self._early), self.noise.fewest_updates
        if count not in (fewest // 2, fewest):
            return
        freedom = max(1.0 - self.p / (self.m * count * self._period / self.INDEPENDENT), 0.25)
        for residual, part in learn_first(self._early, self._theta, self._state.levels, freedom, self._period):
            if count == fewest:
                self.noise.add(residual, part)
        self._spread_count = count
        if count == fewest:
            self._early = []
            self._weigh_anew()

    def _watch(self, Y: FloatArray, innovation: FloatArray, extra: FloatArray, z: float) -> bool:
        """Collect innovations that are too large; True where a jump explains them."""
        if self._lasting is not None or self.settling or self._spread_count == 0 or (self._early_jump and not self.noise.known):
            return False
        if not z > self.THRESHOLD:
            self._search.miss()
            self.misfits = 0
            return False
        if self._search.hits == 0 and self._jump.memory == 0.0:
            self._kept = tuple(x.copy() for x in (self._theta, self._P, self._sensitivity, self._sums.known, self._state.rows))
        self._search.weigh(z, self.m, self._spread_count * self._period / self.INDEPENDENT)
        spread = self._state.levels[SPREAD]
        change = self._search.hit(Y, innovation, spread + extra, self.noise.coloured(spread) + extra)
        self.misfits = self._search.misfits
        if change is None:
            return False
        self.undo_misfits()
        self._take_jump(change)
        return True

    def _look_back(self, Y: FloatArray, tau: FloatArray, lasting: LastingJumpSearch) -> None:
        """Look for a jump that lasts in the rows to come and those before them."""
        too_early, self.disturbed = self._early_jump and not self.noise.known, lasting.disturbed
        if self.settling or self._spread_count == 0 or too_early or not np.isfinite(Y.sum() + tau.sum()):
            return
        if (change := lasting.add(Y, tau, self._theta, self._P, self._state.levels[SPREAD])) is not None:
            self._take_jump(change)

    def _take_jump(self, change: FloatArray) -> None:
        """The block has jumped by ``change``."""
        self.jumps += 1
        self.before_jump, self.last_jump = self._theta[self._jump.block].copy(), change
        if self._jump.memory > 0.0:
            self.settling = max(round(self._jump.memory / self._period), 1)
            self._interrupt_noise()
            self._begin_again()

    def parts(self, where: slice) -> Parts:
        return self._theta[where].copy(), self._P[where, where].copy(), self._sensitivity[where].copy()

    def repeated_covariance(self, where: slice, density: FloatArray, step: float) -> FloatArray:
        return self._sums.repeated(where, density, step)

    def marginal(self, where: slice) -> tuple[FloatArray, FloatArray]:
        return self._theta[where], self._state.variances[where]

    def widen(self, factor: float) -> None:
        self.noise.widen(factor)
        self.noise_variance = self._state.levels[NOISE] = self.noise.variance
        self._state.levels[SPREAD] *= factor

    def shift(self, where: slice, by: FloatArray) -> None:
        super().shift(where, by)
        self._sums.start()

    def fix(self, where: slice, std: float) -> None:
        self._prior_variance[where] = std**2
        self.suppose(where, np.array(std))

    def suppose(self, where: slice, std: FloatArray) -> None:
        kernels.fix(self._theta, self._P, self._sensitivity, where.start, where.stop, std**2)
        self._sums.start()

    def combine(self, where: slice, other: Parts) -> None:
        combine_in(self._theta, self._P, self._sensitivity, where, other)
        self._sums.start()

    def undo_misfits(self) -> None:
        if self._kept:
            self._theta[:], self._P[:], self._sensitivity[:], self._sums.known, self._state.rows[:] = self._kept
            self._kept = ()
        self._search, self.misfits = JumpSearch(self._jump, self._prior_variance), 0

    def forget(self) -> None:
        self._theta[self._jump.block], self.settling = 0.0, 0
        self._spread_count = min(self._spread_count, round(self.SPREAD_ANEW / self._period))
        self._search = JumpSearch(self._jump, self._prior_variance)
        self._interrupt_noise()
        self._begin_again()

    def _settle(self) -> None:
        self.settling -= 1
        if self.settling == 0:
            self._begin_again()
            # what is carried now brings its own noise: that of the positions, through its inertia
            self._spread_count = min(self._spread_count, round(self.SPREAD_ANEW / self._period))

    def _begin_again(self) -> None:
        """Start the block that jumped again, the others from what they are known to; all while the noise is not known."""
        if self.noise.known:
            block = self._jump.block
            self._P[block, :] = self._P[:, block] = 0.0
            self._P[block, block] = np.diag(self._prior_variance[block])
        else:
            self._theta[:], self._P[:] = 0.0, np.diag(self._prior_variance)
            self._sensitivity[:] = 0.0
            self._early = []
            self._early_jump = True
        self._sums.start()

    def _interrupt_noise(self) -> None:
        """Residuals to come do not follow those before."""
        self.noise.interrupt()
        self._blocks.interrupt()
        if self._lasting is not None:
            self._lasting.restart()
