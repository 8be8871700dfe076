"""Standstill: whether something was put on an arm, or taken off, while it stood and friction could hide it."""

from __future__ import annotations

from collections import deque

import numpy as np

from sysid_ros.online.rows import Rows
from sysid_ros.sample import FloatArray

_CREEPS = 0.5
"""Time constant with which dry friction at standstill changes by itself [s]."""
_LIKELIER = 3.0
"""Logarithm of how much likelier a change of the payload must make what is seen: 20 to 1."""
_SHOWS = 0.3
"""What has changed shows, once the arm has moved for so long [s]."""


class Standstill:
    """Compares what is left of the torques of a standing arm with what was left a low-pass's memory before.

    At rest the payload hides in dry friction, which may hold any torque up to its own, so that nothing is learned then. But
    friction does not change at once by itself. Let d be the change of what is left, R the variance of its noise and S that of dry
    friction: ``d ~ N(0, 2 R + 2 S (1 - exp(-T / _CREEPS)))`` where nothing happened, and where the payload changed its own
    covariance ``Y P Y'`` beside, with P that of the prior. Where the second is much likelier, what is carried is not known until
    the arm moves.

    Args:
        prior_variance: of the payload's ten parameters, shape (10,).

    Attributes:
        told: what has happened, in a sentence, as long as the motion has not shown what it was; else empty.
        lasts: the arm stands, or what happened while it stood is still told.
    """

    def __init__(self, prior_variance: FloatArray) -> None:
        self._prior_variance = prior_variance
        self._left: deque[tuple[float, FloatArray]] = deque()
        self._moves_since = 0.0
        self.told = ""
        self.lasts = False

    def add(self, rows: Rows, stands: bool, left: FloatArray, noise: FloatArray, hidden: FloatArray | None, apart: float) -> None:
        """Take in a row.

        Args:
            stands: whether the arm does. left: of the row's torques, shape (n,) [N m]. noise, hidden: variance of a row, and what
                dry friction may hide of it at rest, shape (n,) [(N m)^2]. apart: how long before is compared with [s].
        """
        t = rows.sample.t
        if not stands:
            if self._left:
                self._left.clear()
                self._moves_since = t
            if not 0.0 <= t - self._moves_since <= _SHOWS:  # or the stamps have jumped back
                self.told = ""
            self.lasts = bool(self.told)
            return
        self.lasts = True
        if self._left and not 0.0 < t - self._left[-1][0] < apart:
            self._left.clear()
        self._left.append((t, left))
        if t - self._left[0][0] < apart:
            return
        before, was = self._left.popleft()
        if self.told or hidden is None:
            return
        creep = 2.0 * (1.0 - np.exp(-(t - before) / _CREEPS))
        change, alone = left - was, 2.0 * noise + creep * hidden
        columns = rows.Y[:, : self._prior_variance.size]
        both = np.diag(alone) + (columns * self._prior_variance) @ columns.T
        likelier = _logarithm(change, both) - _logarithm(change, np.diag(alone))
        if likelier > _LIKELIER:
            self.told = (
                f"The torques changed by {np.abs(change).max():.2g} N m within {t - before:.2g} s while the arm stood. "
                "Whether that is the payload or friction shows when it moves."
            )


def _logarithm(x: FloatArray, covariance: FloatArray) -> float:
    """Of the normal density of x, shape (n,), but for a constant."""
    return -0.5 * float(x @ np.linalg.solve(covariance, x) + np.linalg.slogdet(covariance)[1])
