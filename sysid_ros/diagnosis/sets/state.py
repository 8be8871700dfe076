"""What is known of one set of terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.diagnosis.left_out import Predicted
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

Move = tuple[float, tuple[int, ...], int]
"""Score, members and inexactness of a set."""


@dataclass(frozen=True, eq=False)
class State:
    """A set of terms (indices of the pool), the inexactness of the links, what they predict, and the log-probability.

    Attributes:
        narrowed: what it costs that so inexact links could have had other torques, and the rows left them little of that.
    """

    members: tuple[int, ...]
    scale: int
    predicted: Predicted
    narrowed: float
    score: float

    @property
    def likelihood(self) -> FloatArray:
        """Of each stretch, shape (S,)."""
        return self.predicted.likelihood


@dataclass(frozen=True, eq=False)
class Weighed:
    """A set as :class:`State` has it, with the likelihood of each stretch, shape (S,), and nothing else of what it predicts."""

    members: tuple[int, ...]
    scale: int
    likelihood: FloatArray
    narrowed: float
    score: float

    @property
    def move(self) -> Move:
        """To it from another one."""
        return self.score, self.members, self.scale


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters of the terms of a set, those of each after those of the one before, with all rows fitted.

    Attributes:
        theta: shape (m,). covariance: of them, shape (m, m).
    """

    terms: tuple[Term, ...]
    theta: FloatArray
    covariance: FloatArray

    def theta_of(self, term: Term) -> FloatArray:
        """Of one term."""
        return self.theta[self._where(term)]

    def std_of(self, term: Term) -> FloatArray:
        """Their standard deviations."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance)[self._where(term)], 0.0)))

    def _where(self, term: Term) -> slice:
        start = sum(t.p for t in self.terms[: self.terms.index(term)])
        return slice(start, start + term.p)
