"""ExcitationSearch: random feasible motions, and the best ones that gradients find from them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic

import numpy as np

from sysid_ros.excitation.criteria import Criteria, ExcitationCriteria
from sysid_ros.excitation.fourier_trajectory import FourierBasis, FourierTrajectory
from sysid_ros.excitation.optimiser import ConstraintsOf, F, MotionOptimiser, Stage
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

_CRITERIA_STEP = 0.01
_SHRINK = (1.0, 0.999, 0.998, 0.995, 0.99, 0.98, 0.96, 0.93, 0.9)
_HALVINGS = 6

STAGES = (Stage(60.0, 120, False), Stage(300.0, 60, True), Stage(300.0, 30, True), Stage(300.0, 30, True))
"""Far at first, with maxima that are smooth; then up to the limits."""


class ExcitationSearch(Generic[F]):
    """Searches ``max over C of D(C)`` under the limits, C the coefficients of a Fourier series.

    What :class:`MotionOptimiser` finds is checked at 1 ms and, where it is not within all limits, shrunk, or moved back towards
    the feasible motion that the search began from.

    Args:
        criteria: what is maximised. feasibility: the limits. basis: of the motions. constraints: what makes inequalities of the
            limits.
    """

    def __init__(
        self,
        criteria: ExcitationCriteria,
        feasibility: F,
        basis: FourierBasis,
        constraints: ConstraintsOf[F],
        stages: tuple[Stage, ...] = STAGES,
    ) -> None:
        self.stages = stages
        self._criteria, self._feasibility, self._basis = criteria, feasibility, basis
        self._optimiser = MotionOptimiser(criteria, feasibility, basis, constraints)

    def criteria(self, trajectory: FourierTrajectory) -> Criteria:
        """Criteria of a motion, from samples every 10 ms."""
        return self._criteria.evaluate(*trajectory.sample(trajectory.grid(_CRITERIA_STEP, one_period=True)[:-1]))

    def random(self, random: np.random.Generator, postures: FloatArray) -> FourierTrajectory:
        """A random feasible motion about one of some postures, shape (m, n), as large as the limits allow.

        Every harmonic has about the same velocity; each joint is scaled to touch its first limit of position, velocity or
        acceleration, then all together until the torques and collisions are within theirs. Where not a third is left then, the
        next posture is tried with other coefficients, and the largest motion counts.
        """
        largest, best = -1.0, None
        for posture in postures:
            full = self._unhindered(random, posture)
            part, motion = self._largest(full.scaled)
            if part > largest:
                largest, best = part, motion
            if part > TOLERANCES.little:
                break
        assert best is not None
        return best

    def _unhindered(self, random: np.random.Generator, posture: FloatArray) -> FourierTrajectory:
        """Random coefficients, as large as position, velocity and acceleration allow."""
        limits = self._feasibility.limits
        coefficients = random.normal(size=(self._basis.size, len(limits.lower)))
        coefficients[0] = posture
        raw = FourierTrajectory(self._basis, np.array(coefficients))
        q, v, a = raw.sample(raw.grid(_CRITERIA_STEP, one_period=True))
        excursion = q - posture
        tiny = 1e-12
        size = np.max(
            [
                excursion.max(axis=0) / np.maximum(limits.upper - posture, tiny),
                -excursion.min(axis=0) / np.maximum(posture - limits.lower, tiny),
                np.abs(v).max(axis=0) / limits.velocity,
                np.abs(a).max(axis=0) / limits.acceleration,
            ],
            axis=0,
        )
        coefficients[1:] *= TOLERANCES.under / size
        return FourierTrajectory(self._basis, coefficients)

    def _largest(self, motion: Callable[[float], FourierTrajectory]) -> tuple[float, FourierTrajectory]:
        """The largest factor up to 1 that keeps the limits, and its motion; factor 0 does."""
        if self._feasibility.keeps(motion(1.0)):
            return 1.0, motion(1.0)
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._feasibility.keeps(motion(middle)) else (low, middle)
        return low, motion(low)

    def improve(self, begin: FourierTrajectory, progress: Callable[[], None] = lambda: None) -> FourierTrajectory:
        """The best feasible motion on the way from ``begin``, which is feasible, to a local optimum."""
        best, best_d = begin, self.criteria(begin).d
        now = begin
        for stage in self.stages:
            now = self._optimiser.run(now, stage, progress)
            factor, repaired = self._shrunk(now)
            if repaired is None:
                repaired = self._towards(now, best)
                if not self._nearly_feasible(now):
                    # lost in a collision, where gradients say little: on from what is still feasible
                    now = repaired
            better = (d := self.criteria(repaired).d) > best_d
            if better:
                best, best_d = repaired, d
            if stage.exact and better and factor >= TOLERANCES.close:
                break
        return best

    def _shrunk(self, trajectory: FourierTrajectory) -> tuple[float, FourierTrajectory | None]:
        for factor in _SHRINK:
            if self._feasibility.keeps(smaller := trajectory.scaled(factor)):
                return factor, smaller
        return 0.0, None

    def _nearly_feasible(self, trajectory: FourierTrajectory) -> bool:
        use = self._feasibility.use(trajectory, _CRITERIA_STEP)
        return bool(np.all(use.limits < TOLERANCES.nearly_use) and np.all(use.room > TOLERANCES.nearly_room))

    def _towards(self, trajectory: FourierTrajectory, feasible: FourierTrajectory) -> FourierTrajectory:
        target, origin = trajectory.coefficients, feasible.coefficients
        _, motion = self._largest(lambda part: FourierTrajectory(self._basis, origin + part * (target - origin)))
        return motion
