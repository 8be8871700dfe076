"""Estimator: recursive estimation of the parameters of ``tau = Y theta + noise``; Estimate: what it knows, as a value."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from sysid_ros.estimators import kernels
from sysid_ros.estimators.jump_search import JumpRule
from sysid_ros.sample import FloatArray

Noise = tuple[FloatArray, FloatArray, FloatArray] | None
"""As of :meth:`Estimator.compensate`."""
STATUSES = ("warming_up", "ok", "not_excited", "outlier", "not_finite")


Parts = tuple[FloatArray, FloatArray, FloatArray]
"""Values of k parameters, their covariance by noise, and their derivatives by the considered errors: (k,), (k, k), (k, c)."""


class Estimate(NamedTuple):
    """Result of one update.

    Attributes:
        theta: parameters, shape (p,); their covariance is :meth:`Estimator.covariance`, which not every update is asked for.
        innovation: tau - Y theta before the update, shape (m,).
        status: one of :data:`STATUSES`: may this be believed.
        reason: the same in a sentence.
    """

    theta: FloatArray
    innovation: FloatArray
    status: str
    reason: str


@dataclass(frozen=True, slots=True)
class Problem:
    """What there is to estimate.

    Attributes:
        prior_std: standard deviation of each parameter before any data, shape (p,).
        floor: least long-run variance of a row, shape (m,). period: time between updates [s].
        forgetting_time: time constant of what is forgotten [s].
        jump: which parameters may jump.
        part: least variance of a single row as a part of ``floor``, which is that of the mean of many: what a low-pass leaves.
        extra_colour: for how many rows what is added to the noise of one by ``extra_variance`` stays the same.
    """

    prior_std: FloatArray
    floor: FloatArray
    period: float
    forgetting_time: float
    jump: JumpRule
    part: float = 1.0
    extra_colour: float = 1.0


class Estimator(ABC):
    """A recursive estimator of ``tau = Y theta + e``; it knows nothing of robots.

    A new one implements :meth:`update` and :meth:`reset`, and keeps ``_theta``, ``_P`` and ``_sensitivity`` or answers
    :attr:`theta` and :meth:`covariance` in its own way. What it says of noise and jumps is here that the noise is as given and
    that nothing jumps; :func:`sysid_ros.estimators.make_estimator` puts such a one into a :class:`.WatchedEstimator`, which
    adds both.

    Attributes:
        p: number of parameters. m: number of rows of an update.
        watches_itself: True where it learns its noise and finds jumps by itself.
        jumps: how many jumps of the parameters it has found. found_after: updates from a jump until it is found.
        misfits: updates in a row, so far, that are too far from what is known, and that no jump explains.
        disturbed: something acts that is neither noise as it has been nor a jump.
        noise_known: True once covariances rest on noise that the data have shown, or that was given.
        noise_variance: over a long run, of the residual of each row, shape (m,); NaN where nothing was learned of it.
        row_variance: of the residual of single rows, without what follows from their colour, shape (m,); NaN as above.
        before_jump, last_jump: of the parameters that may jump, before the newest one, and by how much they changed.
    """

    watches_itself: ClassVar[bool] = False
    found_after: ClassVar[int] = 0
    jumps: int = 0
    misfits: int = 0
    disturbed: bool = False
    before_jump: FloatArray = np.zeros(0)
    last_jump: FloatArray = np.zeros(0)
    _theta: FloatArray
    _P: FloatArray
    """Covariance of theta, without the considered errors, shape (p, p)."""
    _sensitivity: FloatArray
    """Derivative of theta by the considered errors, shape (p, c)."""

    def __init__(self, p: int, m: int) -> None:
        self.p, self.m = p, m
        self._nothing_considered = np.empty((m, 0))
        self._sensitivity = np.zeros((p, 0))
        self.noise_known = True
        self.noise_variance: FloatArray = np.full(m, np.nan)
        self.row_variance: FloatArray = np.full(m, np.nan)

    @classmethod
    def of(cls, problem: Problem) -> Estimator:
        """The estimator for a problem; here of a class that is made from prior, floor, period and forgetting time."""
        make: Any = cls
        made: Estimator = make(problem.prior_std, problem.floor, problem.period, problem.forgetting_time)
        return made

    @property
    def theta(self) -> FloatArray:
        """Parameters as they are now, shape (p,)."""
        return self._theta.copy()

    def covariance(self) -> FloatArray:
        """Covariance of theta as it is now, with what the considered errors do to it, shape (p, p)."""
        if self._sensitivity.shape[1] == 0:
            return self._P.copy()
        return self._P + self._sensitivity @ self._sensitivity.T

    def predict(self, Y: FloatArray, tau: FloatArray, extra_variance: FloatArray | None = None) -> tuple[float, float]:
        """Of rows that are not taken in: normalised innovation ``nu' S^-1 nu / m`` with ``S = Y P Y' + R``, 1 in the mean where
        they fit what is known, and logarithm of their likelihood; NaN where the noise of a row is not known.

        Args:
            Y: shape (m, p). tau, extra_variance: shape (m,).
        """
        extra = np.zeros(self.m) if extra_variance is None else extra_variance
        square, logarithm = kernels.predict(Y, self.noise_covariance(), self.row_variance, extra, tau - Y @ self.theta)
        return square / self.m, -0.5 * (square + logarithm)

    @property
    def sensitivity(self) -> FloatArray:
        """What unit considered errors do to theta, shape (p, c); c = 0 where none are considered."""
        return self._sensitivity.copy()

    def parts(self, where: slice) -> Parts:
        """Some of the parameters, (k,), covariance without the considered errors, (k, k), and sensitivity to these, (k, c)."""
        return self.theta[where], self.noise_covariance()[where, where], self.sensitivity[where]

    def repeated_covariance(self, where: slice, density: FloatArray, step: float) -> FloatArray:
        """Covariance of some of the parameters that errors make which return as they were, and so do not average out, (k, k);
        here none, as of an estimator that does not know from how many rows it learned.

        Args:
            density: of these errors within a step, as the long-run variance of a row, shape (m,). step: rows until they return.
        """
        size = len(range(*where.indices(self.p)))
        return np.zeros((size, size))

    def marginal(self, where: slice) -> tuple[FloatArray, FloatArray]:
        """Some of the parameters, and their variance but for what the considered errors make, shapes (k,)."""
        return self.theta[where], np.array(self.noise_covariance().diagonal()[where])

    def noise_covariance(self) -> FloatArray:
        """The part of the covariance that is not of the considered errors, shape (p, p)."""
        return self._P.copy() if self._sensitivity.shape[1] else self.covariance()

    def _estimate(self, innovation: FloatArray, status: str, reason: str) -> Estimate:
        return Estimate(self._theta.copy(), innovation, status, reason)

    @abstractmethod
    def update(
        self,
        Y: FloatArray,
        tau: FloatArray,
        hold: bool = False,
        extra_variance: FloatArray | None = None,
        considered: FloatArray | None = None,
    ) -> Estimate:
        """Take in one set of rows, ``tau = Y theta + Z z + noise``.

        Args:
            Y: shape (m, p). tau: shape (m,).
            hold: True where nothing excites the parameters: the covariance neither shrinks nor grows.
            extra_variance: added to the noise of each row, shape (m,); to that of the mean of many :attr:`Problem.extra_colour`
                times as much.
            considered: Z, shape (m, c), where z ~ N(0, 1) is an error of what is taken as known. It is not estimated, but what it
                does to theta is in the covariance.
        """

    def compensate(self, noise: Noise, hold: bool, extra_variance: FloatArray | None) -> None:  # noqa: B027
        """Take out what errors of the regressors have brought in since the last time. ``Y + Y_n``, where the noise ``Y_n`` is
        that of the rows too, looks like information, and draws theta towards what makes the noise small (errors in variables; the
        bias is compensated as by Stoica, Soderstrom 1982). Here nothing, as of an estimator that lives with it.

        Args:
            noise: in a row, one standard deviation of each of k sources: in Y, shape (k, m, p), tau (k, m), Z (k, m, c); or None.
            hold, extra_variance: as of :meth:`update`, for the rows that it was in.
        """

    def _fit_considered(self, considered: FloatArray | None) -> FloatArray:
        """Z, shape (m, c), with all that belongs to the considered errors made to fit it."""
        Z = self._nothing_considered if considered is None else considered
        if Z.shape[1] != self._sensitivity.shape[1]:
            self._consider(Z.shape[1])
        return Z

    def _consider(self, count: int) -> None:
        """Consider another number of errors; what the ones before did is forgotten."""
        self._sensitivity = np.zeros((self.p, count))

    def widen(self, factor: float) -> None:  # noqa: B027 - one whose noise is given keeps it
        """The noise of the rows is ``factor`` times the variance that was learned; here nothing."""

    def shift(self, where: slice, by: FloatArray) -> None:
        """What counts as zero of the parameters ``where`` has changed: they become larger by ``by``."""
        self._theta[where] += by

    def fix(self, where: slice, std: float) -> None:  # noqa: B027 - one that goes on estimating them is right too
        """From now on the parameters ``where`` are known to be zero to within ``std``; here nothing."""

    def suppose(self, where: slice, std: FloatArray) -> None:  # noqa: B027 - one that learns it from rows to come is right too
        """The parameters ``where`` are zero now to within ``std``, shape (k,); here nothing."""

    def combine(self, where: slice, other: Parts) -> None:  # noqa: B027 - one that learns it from rows to come is right too
        """Other rows, not among these, say ``other`` of the parameters ``where``, as :meth:`parts` has it; here nothing."""

    def undo_misfits(self) -> None:  # noqa: B027 - one that finds none has nothing to do
        """Go back to before the rows that count as ``misfits``; here nothing, as of an estimator that finds none."""

    def forget(self) -> None:
        """Forget the parameters that may jump, and keep what is known of the noise; here as :meth:`reset`."""
        self.reset()

    @abstractmethod
    def reset(self) -> None:
        """Forget everything but the prior."""
