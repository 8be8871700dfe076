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

    Attributes:
        theta: shape (10,). noise: its covariance without the considered errors, shape (10, 10). sensitivity: to those, shape
            (10, c). taken: False of the one that nobody asked for.
    """

    theta: FloatArray = field(default_factory=lambda: np.zeros(10))
    noise: FloatArray = field(default_factory=lambda: np.zeros((10, 10)))
    sensitivity: FloatArray = field(default_factory=lambda: np.zeros((10, 0)))
    taken: bool = False

    @classmethod
    def of(cls, estimator: Estimator, repeated: FloatArray) -> Tare:
        """What the estimator has now; ``repeated``: covariance beside that which it knows of, shape (10, 10)."""
        noise, sensitivity = estimator.covariance_parts(PAYLOAD)
        return cls(estimator.theta[PAYLOAD], noise + repeated, sensitivity, True)

    def covariances(self, estimator: Estimator) -> tuple[FloatArray, FloatArray]:
        """Of the tared payload: what noise and what considered errors make, shape (10, 10) each."""
        noise, sensitivity = estimator.covariance_parts(PAYLOAD)
        if self.taken and sensitivity.shape == self.sensitivity.shape:
            sensitivity -= self.sensitivity
        return noise + self.noise, sensitivity @ sensitivity.T
