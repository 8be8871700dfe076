"""Standstill: whether something was put on an arm, or taken off, while it hardly moved and friction could hide it."""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy import special

from sysid_ros.estimators import Estimator
from sysid_ros.online.rows import Rows
from sysid_ros.sample import FloatArray

_CREEPS = 0.5
"""Time constant with which dry friction at standstill changes by itself [s]."""
_CHANGES = 0.05
"""Chance that what is carried changes while the arm stops, before any data."""
_DOUBTED = 0.05
"""Chance of a change from which on what is known is doubted: an interval of 95 % promises to be wrong no more often."""
_SHOWS = 0.3
"""What has changed shows, once the arm has moved for so long [s]."""


class Standstill:
    """Compares what is left of the torques of an arm that hardly moves with what was left a low-pass's memory T before.

    There the payload hides in dry friction, which may hold any torque up to its own, so that little is learned, and nothing at
    rest. But friction does not change at once by itself. With S(t) the variance of what it may hide of a row, it changes within T
    by the variance ``S(t) + S(t - T) - 2 exp(-T / _CREEPS) sqrt(S(t) S(t - T))``: nearly all of S where the arm stops in between,
    a part where it has stood all the time. Let d be the change of what is left, ``D`` that variance, that of the noise of both
    rows and that of what the change of the columns makes of the errors of all parameters: ``d ~ N(0, D)`` where nothing happened,
    and where something else is carried since, its own covariance ``Y P0 Y'`` beside, with that of the prior. Where nothing is,
    which is what becomes of a load as a rule, ``d + Y_p (theta_p - empty)`` is what happened to the rest: that has no parameter
    to fit, and shows where any other payload would be hidden. Both are as usual. Where a change is not as improbable as an
    interval of 95 % takes it to be, what is carried is not known until the arm moves.

    Args:
        prior_variance: of the payload's ten parameters, shape (10,).

    Attributes:
        told: what has happened, in a sentence, as long as the motion has not shown what it was; else empty.
        lasts: the arm hardly moves, or what happened while it did is still told.
    """

    def __init__(self, prior_variance: FloatArray) -> None:
        self._prior_variance = prior_variance
        self._before: deque[tuple[Rows, FloatArray]] = deque()
        self._moves_since = 0.0
        self.told = ""
        self.lasts = False

    def add(
        self, rows: Rows, quiet: bool, estimator: Estimator, hidden: FloatArray | None, apart: float, empty: FloatArray
    ) -> None:
        """Take in a row.

        Args:
            quiet: whether the arm hardly moves, and the noise is known. estimator: that knows the parameters and the noise.
            hidden: variance of what dry friction may hide, shape (n,) [(N m)^2]. apart: how long before is compared with [s].
            empty: parameters of what counts as nothing, shape (10,).
        """
        t = rows.t
        if not quiet or hidden is None:
            if self._before:
                self._before.clear()
                self._moves_since = t
            if not 0.0 <= t - self._moves_since <= _SHOWS:  # or the stamps have jumped back
                self.told = ""
            self.lasts = bool(self.told)
            return
        self.lasts = True
        if self._before and not 0.0 < t - self._before[-1][0].t < apart:
            self._before.clear()
        self._before.append((rows, hidden))
        if t - self._before[0][0].t < apart:
            return
        was, could = self._before.popleft()
        if not self.told:
            self._compare(rows, hidden, was, could, estimator, empty)

    def clear(self) -> None:
        """Rows to come are not those of before; what has happened is told on."""
        self._before.clear()

    def _compare(
        self, rows: Rows, hidden: FloatArray, was: Rows, could: FloatArray, estimator: Estimator, empty: FloatArray
    ) -> None:
        apart = rows.t - was.t
        load, P = slice(0, self._prior_variance.size), estimator.noise_covariance()
        columns, considered = rows.Y - was.Y, rows.considered - was.considered
        change = rows.y - was.y - columns @ estimator.theta
        keeps = np.exp(-apart / _CREEPS)
        friction = np.maximum(hidden + could - 2.0 * keeps * np.sqrt(hidden * could), 0.0)
        beside = np.diag(2.0 * estimator.row_variance + friction) + considered @ considered.T
        alone = beside + columns @ P @ columns.T
        payload = rows.Y[:, load]
        another = alone + (payload * self._prior_variance) @ payload.T
        columns[:, load] -= payload
        gone = change + payload @ (estimator.theta[load] - empty)
        changed = np.logaddexp(_logarithm(change, another), _logarithm(gone, beside + columns @ P @ columns.T)) - np.log(2.0)
        if changed - _logarithm(change, alone) + special.logit(_CHANGES) > special.logit(_DOUBTED):
            self.told = (
                f"The torques changed by {np.abs(change).max():.2g} N m within {apart:.2g} s while the arm stood, or nearly so. "
                "Whether that is the payload or friction shows when it moves."
            )


def _logarithm(x: FloatArray, covariance: FloatArray) -> float:
    """Of the normal density of x, shape (n,), but for a constant."""
    return -0.5 * float(x @ np.linalg.solve(covariance, x) + np.linalg.slogdet(covariance)[1])
