"""Tare: an estimate that is taken as zero from then on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sysid_ros.estimators import Estimator
from sysid_ros.online.free_parameters import PAYLOAD
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Tare:
    """The payload's parameters that count as nothing: ``theta - theta_0``.

    Noise of both adds up. Errors of the links are the same in both, so that what they do to the difference is the difference of
    what they do: ``(S - S_0) z``. On the motion of the tare it is nothing; on another one what is left of it.

    What every step of a gait repeats is in part the same in both, and goes with the tare; how much of it, from nothing to all, is
    not known. With a correlation c that lies anywhere from 0 to 1 two errors of the variance R differ by ``2 (1 - c) R``, on the
    mean R.

    Attributes:
        theta: shape (10,). noise: its covariance without the considered errors and what is repeated, shape (10, 10). sensitivity:
            to those errors, shape (10, c). repeated: covariance of what is, shape (10, 10). taken: False of the one that nobody
            asked for.
    """

    theta: FloatArray = field(default_factory=lambda: np.zeros(10))
    noise: FloatArray = field(default_factory=lambda: np.zeros((10, 10)))
    sensitivity: FloatArray = field(default_factory=lambda: np.zeros((10, 0)))
    repeated: FloatArray = field(default_factory=lambda: np.zeros((10, 10)))
    taken: bool = False

    @classmethod
    def of(cls, estimator: Estimator, repeated: FloatArray) -> Tare:
        """What the estimator has now; ``repeated``: covariance of what every step repeats, shape (10, 10)."""
        theta, noise, sensitivity = estimator.parts(PAYLOAD)
        return cls(theta, noise, sensitivity, repeated, True)

    def tared(self, estimator: Estimator, repeated: FloatArray | None = None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The tared payload, shape (10,), and the covariances that noise and that considered errors make, shape (10, 10) each;
        ``repeated``: what every step repeats makes now, as noise does."""
        theta, noise, sensitivity = estimator.parts(PAYLOAD)
        if self.taken and sensitivity.shape == self.sensitivity.shape:
            sensitivity -= self.sensitivity
        if repeated is not None:
            noise += 0.5 * (self.repeated + repeated) if self.taken else repeated
        return theta - self.theta, noise + self.noise, sensitivity @ sensitivity.T
