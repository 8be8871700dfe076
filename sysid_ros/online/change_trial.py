"""ChangeTrial: whether a jump of the estimate was a body that is carried from then on, or a force that passes."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from enum import Enum

import numpy as np

from sysid_ros.estimators import Estimator
from sysid_ros.online.free_parameters import LEAST_JUMP, PAYLOAD
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.online.tare import Tare
from sysid_ros.robot.inertial_parameters import project_into
from sysid_ros.sample import FloatArray

_FITS = 4.0
"""Normalised innovation up to which a row fits, as in :class:`.variable_forgetting.VariableForgetting`."""
_YOUNG = 0.8
"""Before so long nothing is judged [memories of the low-pass]."""
_RETURNED = 1.2
"""What was known before fits again for so long: longer than the low-pass remembers [its memories]."""
_LIKELIER = 3.0
"""Logarithm of how much likelier it must be than what is estimated since: 20 to 1."""
_JUMPS = 4
"""So many jumps before one has settled are no body: what is carried does not change all the time."""
_STAYS = 0.5
"""So long without another jump, a body that is well known is one [s]."""
_LONGEST = 3.0
"""What is no more than chance after so long is what was carried before; a force that has not passed after so long may be a body
[s]."""
_MATTERS = np.diag(np.square([*LEAST_JUMP[:4], *[1e-3] * 6]))
"""What is too small for a body is too small for a force: nothing is carried, and the model is a little wrong."""
_TOLD = 0.3
"""Part of the prior's standard deviation up to which a parameter is told by the rows."""
_NO_BODY = 29.6
"""99.9 % quantile of chi-squared with 10 degrees of freedom."""


class Verdict(Enum):
    """OPEN: not known yet. BODY: it is carried. DOUBT: it is none as the time of the change was taken; that is looked for again.
    FORCE: it is no body; it acts still. PASSED: what was before is again; ALL_PASSED: what was before the outer trial. AGAIN: a
    force that stays is tried as a body once more. SAME: it is what was carried before, as far as rows of both times tell.
    BEFORE: it is, and what was known before fits again."""

    OPEN = 0
    BODY = 1
    FORCE = 2
    PASSED = 3
    AGAIN = 4
    DOUBT = 5
    ALL_PASSED = 6
    SAME = 7
    BEFORE = 8


class ChangeTrial:
    """Keeps what was known before a jump beside what is estimated since, and compares both with what comes.

    A body has a positive mass, its centre of mass within ``reach``, and an inertia; its torque follows the motion, so that no
    further jump is needed; and it stays. A force does none of these in the long run: a push that ends leaves rows that fit what
    was known before it.

    Args:
        before: the estimator as it was before the jump. t: of the jump [s]. mass: carried before it [kg].
        reach: how far from the frame a centre of mass can be [m]. prior_std: of the payload, shape (10,).
        empty: mass below which there is no payload [kg].
        front_end: that the rows come from.
        after: a trial that ended in a force which has stayed, and which may be a body that moves by itself, as one that swings.
        strain: of it. outer: a trial that was open, and had been at rest, when this one began.

    Attributes:
        before, t, mass: as given. force: True once it is known to be no body. strain: variance that the rows would need to be
            those of a body, over that of their noise. likelier_until: what ``another`` of :meth:`judge` said before the newest
            jump.
    """

    def __init__(
        self,
        before: Estimator,
        t: float,
        mass: float,
        reach: float,
        prior_std: FloatArray,
        empty: float,
        front_end: FrontEnd,
        after: ChangeTrial | None = None,
        strain: float = 1.0,
        outer: ChangeTrial | None = None,
    ) -> None:
        self.after, self.outer = after, outer
        self.strain = self._assumed = strain
        self.before, self.t, self.mass, self._reach = before, t, mass, reach
        self.force, self._doubted, self.likelier_until = False, False, math.inf
        self._prior_std, self._empty = prior_std, empty
        self._jumps, self._newest, self._force_since = 1, t, t
        self._impossible_since = np.inf
        self._part, self._young, self._returned = front_end.passed, _YOUNG * front_end.memory, _RETURNED * front_end.memory
        rows = max(round(self._returned / front_end.period), 2)
        self._compared: deque[tuple[float, float]] = deque(maxlen=rows)
        self._one = 1.0 / (self._part * rows)

    def once_more(self, t: float, front_end: FrontEnd) -> ChangeTrial:
        """The trial of a force that has stayed until ``t`` [s], as a body that moves by itself."""
        about = self.before, t, self.mass, self._reach, self._prior_std, self._empty, front_end
        return ChangeTrial(*about, after=self.after or self, strain=self.strain, outer=self.outer)

    def rests(self, t: float) -> bool:
        """Whether no further jump was found for a while before ``t`` [s], so that the next one is another change."""
        return not self.force and t - self._newest >= _STAYS

    def jumped(self, t: float, until: Estimator | None = None) -> None:
        """Another jump was found at ``t`` [s]; ``until``: what was estimated until then since the one before. Where that need
        not be another payload than before, nothing had changed yet."""
        if until is not None and not self.force and not self.changed_by(until):
            self.t = t
        self._jumps, self._newest = self._jumps + 1, t
        self._impossible_since = np.inf
        self._compared.clear()

    def change(self, since: Estimator) -> FloatArray:
        """By how much the payload is another, as ``since`` estimates it, shape (10,)."""
        return np.asarray(since.theta[PAYLOAD] - self.before.theta[PAYLOAD])

    def changed_by(self, until: Estimator) -> bool:
        """Whether ``until``, estimated since it began, is of another payload than before."""
        return self.likelier_until > _LIKELIER and self._against_before(until) is Verdict.BODY

    def resumed_outer(self) -> ChangeTrial | None:
        """The trial that goes on when this one is over; what it compared with the estimate since this one began tells nothing."""
        if self.outer is not None:
            self.outer._compared.clear()
        return self.outer

    def compare(self, Y: FloatArray, y: FloatArray, extra: FloatArray | None, estimator: Estimator, stands: bool) -> None:
        """How likely a row is, shapes (m, p) and (m,), after what was before and after what ``estimator`` has learned since,
        which has not seen it; with ``extra`` variance (m,). While the robot ``stands``, what friction hides of its rows is the
        same in all: they count as one."""
        if self.outer is not None:
            self.outer.compare(Y, y, extra, estimator, stands)
        misfit, likely = self.before.predict(Y, y, extra)
        likelier = np.inf if self.force else likely - estimator.predict(Y, y, extra)[1]
        self._compared.append((misfit, likelier * self._one if stands else likelier))

    def judge(self, t: float, estimator: Estimator, tare: Tare, another: Callable[[FloatArray], float] | None = None) -> Verdict:
        """What is known at ``t`` [s], after the estimator has taken in the row that was compared; ``another``: logarithm of how
        much likelier another payload, changed by so much, is than the one before with all that may be wrong with the robot."""
        passed = self.has_passed()
        if self.outer is not None and self.outer.has_passed() and not (passed and self.likelier() >= self.outer.likelier()):
            return Verdict.ALL_PASSED
        if passed:
            return Verdict.PASSED if self.force or self._was_force(estimator) else Verdict.BEFORE
        if self.force:
            return Verdict.AGAIN if t - self._force_since > _LONGEST else Verdict.FORCE
        if t - self._newest < self._young:
            return Verdict.OPEN
        self._impossible_since = np.inf if self._possible(estimator, tare) else min(self._impossible_since, t)
        if self._jumps >= _JUMPS or t - self._impossible_since >= self._returned:
            if not self._doubted:
                self._doubted, self._jumps = True, 0
                return Verdict.DOUBT
            self.force, self._force_since = True, t
            return Verdict.FORCE
        clear = self._well_known(estimator) or self._is_nothing(estimator, tare)
        settled = t - self._newest >= (_STAYS if clear else _LONGEST)
        if not settled or self._impossible_since <= t:
            return Verdict.OPEN
        verdict = self._against_before(estimator)
        if verdict is Verdict.BODY and another is not None and another(self.change(estimator)) <= _LIKELIER:
            verdict = Verdict.OPEN
        return Verdict.SAME if verdict is Verdict.OPEN and t - self._newest >= _LONGEST else verdict

    def has_passed(self) -> bool:
        """What was before is again: it has fitted for a while, and is likelier than what is estimated since."""
        fits = len(self._compared) == self._compared.maxlen and max(misfit for misfit, _ in self._compared) <= _FITS
        return fits and self.likelier() > _LIKELIER

    def likelier(self) -> float:
        """Logarithm of how much likelier than what is estimated since what was before makes the rows that were compared."""
        return self._part * float(sum(likelier for _, likelier in self._compared))

    def mass_after(self, estimator: Estimator, tare: Tare) -> float:
        """Mass that is carried as far as is known yet [kg]: of what may be a body it is not negative, however little is known."""
        mass = float(estimator.theta[0] - tare.theta[0])
        return max(mass, 0.0) if self._distance(estimator, tare)[0] <= _NO_BODY else mass

    def _distance(self, estimator: Estimator, tare: Tare) -> tuple[float, FloatArray, FloatArray]:
        """Squared distance of what is estimated from the nearest body, by its covariance; estimate and covariance."""
        theta, noise, model = tare.tared(estimator)
        covariance = noise + model
        return float(project_into(theta, covariance + _MATTERS, np.empty(10))), theta, covariance

    def _possible(self, estimator: Estimator, tare: Tare) -> bool:
        """Whether some body has the parameters that are estimated."""
        distance, theta, covariance = self._distance(estimator, tare)
        if not distance <= _NO_BODY:
            if np.isfinite(distance):
                self.strain = max(self._assumed * distance / 10.0, self.strain)
            return False
        std = np.sqrt(covariance.diagonal())
        heaviest = max(theta[0] + 3.0 * std[0], 0.0)
        return bool(np.all(np.abs(theta[1:4]) - 3.0 * std[1:4] <= heaviest * self._reach))

    def _against_before(self, estimator: Estimator) -> Verdict:
        """Whether one payload explains what was estimated before and since: BODY where they differ by more than chance, SAME
        where they do not and differ by less than what counts as one, else OPEN. Errors of the model are the same in both.

        A difference d of the covariance C is likelier of another payload, which differs by ``P`` as its prior says, than of the
        same by ``N(d; 0, C + P) / N(d; 0, C)``; so is that of the masses alone."""
        now, noise, by_model = estimator.parts(PAYLOAD)
        was, its_noise, as_before = self.before.parts(PAYLOAD)
        differs = by_model - as_before if by_model.shape == as_before.shape else np.hstack([by_model, as_before])
        same = noise + its_noise + differs @ differs.T + _MATTERS
        other = same + np.diag(self._prior_std**2)
        moved = now - was
        if _log_density(moved, other) - _log_density(moved, same) > _LIKELIER:
            return Verdict.BODY
        if abs(float(moved[0])) < self._empty:
            return Verdict.SAME
        mass = moved[:1], same[:1, :1], other[:1, :1]
        return Verdict.BODY if _log_density(mass[0], mass[2]) > _log_density(mass[0], mass[1]) else Verdict.OPEN

    def _was_force(self, estimator: Estimator) -> bool:
        """Whether what has passed was more than the model is wrong by: it looked like another body, or too little was seen."""
        unknown = np.sqrt(estimator.noise_covariance()[0, 0]) > _TOLD * self._prior_std[0]
        return bool(unknown) or self._against_before(estimator) is Verdict.BODY

    def _is_nothing(self, estimator: Estimator, tare: Tare) -> bool:
        """Whether nothing is carried: no force makes that of a body."""
        theta, noise, model = tare.tared(estimator)
        covariance = noise + model + _MATTERS
        known = bool(np.all(np.sqrt(noise.diagonal()[:4]) <= 3.0 * np.array(LEAST_JUMP[:4])))
        return known and float(theta @ np.linalg.solve(covariance, theta)) <= _NO_BODY

    def _well_known(self, estimator: Estimator) -> bool:
        """Whether mass and centre of mass are known so well that a force would show."""
        theta, std = estimator.theta[PAYLOAD], np.sqrt(estimator.noise_covariance().diagonal())[PAYLOAD]
        mass = max(abs(float(theta[0])), 0.3)
        told = bool(np.all(std[:4] <= _TOLD * self._prior_std[:4]))  # by the motion, not by the prior
        return told and bool(std[0] <= 0.05 * mass and np.all(std[1:4] <= 0.03 * mass))


def _log_density(x: FloatArray, covariance: FloatArray) -> float:
    """Logarithm of the density of x, shape (k,), that is normal about zero, but for what is common to all of one k."""
    root = np.linalg.cholesky(covariance)
    way = np.linalg.solve(root, x)
    return float(-0.5 * way @ way - np.log(np.diag(root)).sum())
