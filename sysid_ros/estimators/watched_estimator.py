"""WatchedEstimator: any estimator, with what it needs to be believed: noise that is learned, and jumps that are found."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sysid_ros.estimators.estimator import Estimate, Estimator, Noise, Parts, Problem
from sysid_ros.estimators.jump_search import JumpSearch
from sysid_ros.estimators.variable_forgetting import VariableForgetting
from sysid_ros.sample import FloatArray


class WatchedEstimator(Estimator):
    """Another estimator, beside a :class:`.VariableForgetting` that takes in the same rows and watches them.

    Innovations of the other one need not show a jump: the faster it follows, the larger is what it takes for chance. Those of the
    watch do, whatever the other one is. From it come the noise of the rows, of which what exceeds the floor is given to the other
    one as extra variance, and the jumps, after which the other one forgets, once more when the old data have left the filters.

    Args:
        inner: the other one, of whose methods only those of :class:`Estimator` that are abstract are needed.
        problem: that it was made for.
    """

    watches_itself: ClassVar[bool] = True
    found_after: ClassVar[int] = JumpSearch.HITS

    def __init__(self, inner: Estimator, problem: Problem) -> None:
        super().__init__(inner.p, inner.m)
        self._inner, self._floor, self._colour = inner, problem.floor, problem.extra_colour
        self._clean = problem.jump.memory == 0.0
        self._watch = VariableForgetting.of(problem)
        self.found_after = self._watch.found_after  # type: ignore[misc]
        self._see()

    def _see(self) -> None:
        """Take over what the watch knows."""
        watch = self._watch
        self.noise_known, self.noise_variance, self.row_variance = watch.noise_known, watch.noise_variance, watch.row_variance
        self.jumps, self.last_jump, self.before_jump = watch.jumps, watch.last_jump, watch.before_jump
        self.misfits = watch.misfits

    def reset(self) -> None:
        self._inner.reset()
        self._watch.reset()
        self._see()

    def repeated_covariance(self, where: slice, density: FloatArray, step: float) -> FloatArray:
        return self._watch.repeated_covariance(where, density, step)

    def widen(self, factor: float) -> None:
        self._watch.widen(factor)
        self._see()

    def shift(self, where: slice, by: FloatArray) -> None:
        self._inner.shift(where, by)
        self._watch.shift(where, by)

    def compensate(self, noise: Noise, hold: bool, extra_variance: FloatArray | None) -> None:
        self._inner.compensate(noise, hold, extra_variance)
        self._watch.compensate(noise, hold, extra_variance)

    def fix(self, where: slice, std: float) -> None:
        self._inner.fix(where, std)
        self._watch.fix(where, std)

    def suppose(self, where: slice, std: FloatArray) -> None:
        self._inner.suppose(where, std)
        self._watch.suppose(where, std)

    def combine(self, where: slice, other: Parts) -> None:
        self._inner.combine(where, other)
        self._watch.combine(where, other)

    def undo_misfits(self) -> None:
        self._watch.undo_misfits()
        self._see()

    def forget(self) -> None:
        self._inner.forget()
        self._watch.forget()

    @property
    def theta(self) -> FloatArray:
        return self._inner.theta

    def covariance(self) -> FloatArray:
        return self._inner.covariance()

    def predict(self, Y: FloatArray, tau: FloatArray, extra_variance: FloatArray | None = None) -> tuple[float, float]:
        return self._watch.predict(Y, tau, extra_variance)

    @property
    def sensitivity(self) -> FloatArray:
        return self._inner.sensitivity

    def noise_covariance(self) -> FloatArray:
        return self._inner.noise_covariance()

    def update(
        self,
        Y: FloatArray,
        tau: FloatArray,
        hold: bool = False,
        extra_variance: FloatArray | None = None,
        considered: FloatArray | None = None,
    ) -> Estimate:
        settling = self._watch.settling
        seen = self._watch.update(Y, tau, hold, extra_variance, considered)
        jumped = self._watch.jumps != self.jumps
        if (jumped and not self._clean) or (settling and not self._watch.settling):
            self._inner.forget()
        self._see()
        if jumped and self._clean:
            return Estimate(self.theta, seen.innovation, seen.status, seen.reason)
        variance = self.noise_variance if extra_variance is None else self.noise_variance + self._colour * extra_variance
        if seen.status == "outlier":
            variance = variance + seen.innovation**2
        extra = np.maximum(variance - self._floor, 0.0)
        estimate = self._inner.update(Y, tau, seen.status == "not_excited", extra, considered)
        if estimate.status == "ok" and seen.status != "ok":
            return estimate._replace(status=seen.status, reason=seen.reason)
        return estimate
