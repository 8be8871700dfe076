"""Estimator: recursive estimation of the parameters of ``tau = Y theta + noise``; Estimate: what it knows, as a value."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray

STATUSES = ("warming_up", "ok", "not_excited", "outlier", "not_finite")


_ABSURD = 1e9


@dataclass(frozen=True, slots=True)
class Estimate:
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

    p: int
    m: int
    _sensitivity: FloatArray
    """Derivative of theta by the considered errors, shape (p, c)."""

    @property
    @abstractmethod
    def theta(self) -> FloatArray:
        """Parameters as they are now, shape (p,)."""

    @abstractmethod
    def covariance(self) -> FloatArray:
        """Covariance of theta as it is now, shape (p, p)."""

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

    @staticmethod
    def usable(Y: FloatArray, tau: FloatArray) -> bool:
        """True where the rows are finite and so small that their squares do not overflow what they are added to."""
        return bool(np.abs(Y).max() < _ABSURD and np.abs(tau).max() < _ABSURD)

    def _fit_sensitivity(self, considered: FloatArray | None) -> FloatArray:
        """Z, shape (m, c), with the sensitivity made to fit it."""
        Z = np.empty((self.m, 0)) if considered is None else considered
        if Z.shape[1] != self._sensitivity.shape[1]:
            self._sensitivity = np.zeros((self.p, Z.shape[1]))
        return Z

    @abstractmethod
    def reset(self) -> None:
        """Forget everything but the prior."""
