"""Estimator: recursive estimation of the parameters of ``tau = Y theta + noise``; Estimate: what it knows, as a value."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from sysid_ros.sample import FloatArray

STATUSES = ("warming_up", "ok", "not_excited", "outlier", "not_finite")


class Estimate(NamedTuple):
    """Result of one update.

    Attributes:
        theta: parameters, shape (p,).
        covariance: of theta, shape (p, p).
        innovation: tau - Y theta before the update, shape (m,).
        status: one of :data:`STATUSES`: may this be believed.
        reason: the same in a sentence.
    """

    theta: FloatArray
    covariance: FloatArray
    innovation: FloatArray
    status: str
    reason: str


class Estimator(ABC):
    """A recursive estimator of ``tau = Y theta + e``; it knows nothing of robots.

    Attributes:
        p: number of parameters. m: number of rows of an update.
    """

    _theta: FloatArray
    _P: FloatArray
    """Covariance of theta, without the considered errors, shape (p, p)."""
    _sensitivity: FloatArray
    """Derivative of theta by the considered errors, shape (p, c)."""

    def __init__(self, p: int, m: int) -> None:
        self.p, self.m = p, m
        self._nothing_considered = np.empty((m, 0))

    @property
    def theta(self) -> FloatArray:
        """Parameters as they are now, shape (p,)."""
        return self._theta.copy()

    def covariance(self) -> FloatArray:
        """Covariance of theta as it is now, with what the considered errors do to it, shape (p, p)."""
        if self._sensitivity.shape[1] == 0:
            return self._P.copy()
        return self._P + self._sensitivity @ self._sensitivity.T

    def _estimate(self, innovation: FloatArray, status: str, reason: str) -> Estimate:
        return Estimate(self._theta.copy(), self.covariance(), innovation, status, reason)

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
            extra_variance: added to the noise of each row, shape (m,).
            considered: Z, shape (m, c), where z ~ N(0, 1) is an error of what is taken as known. It is not estimated, but what it
                does to theta is in the covariance.
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

    def forget(self) -> None:
        """Forget the parameters that may jump, and keep what is known of the noise; here as :meth:`reset`."""
        self.reset()

    @abstractmethod
    def reset(self) -> None:
        """Forget everything but the prior."""
