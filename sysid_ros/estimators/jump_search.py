"""JumpSearch: a change of the parameters, found from the innovations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class JumpRule:
    """Which parameters may jump, and what counts as a jump.

    Attributes:
        block: the parameters that may jump.
        least: change of the block's parameters of which one must be exceeded, shape (size of block,); infinite where it does
            not count.
        memory: time after a jump during which old data are still in the rows [s].
    """

    block: slice
    least: FloatArray
    memory: float


class JumpSearch:
    """A run of innovations that are too large for what is known, fitted with a jump of the parameters that may jump (Willsky,
    Jones 1976).

    Args:
        rule: which parameters, and what counts. prior_variance: of all parameters, shape (p,).

    Attributes:
        hits: innovations in the run so far.
    """

    HITS = 5
    EXPLAINED = 0.8
    SIGNIFICANT = 25.0

    def __init__(self, rule: JumpRule, prior_variance: FloatArray) -> None:
        self.rule = rule
        self._prior_information = np.diag(1.0 / prior_variance[rule.block])
        self._clear()

    def miss(self) -> None:
        """An innovation that fits what is known."""
        self.hits -= 1
        if self.hits <= 0:
            self._clear()

    def hit(self, Y: FloatArray, innovation: FloatArray, variance: FloatArray, coloured: FloatArray) -> FloatArray | None:
        """An innovation that does not fit: the change of the block that explains the run, once it is long enough.

        Args:
            Y: shape (m, p). innovation: shape (m,). variance, coloured: of a single row, and over a long run, shape (m,).
        """
        self.hits += 1
        block = Y[:, self.rule.block]
        weighted = block / variance[:, None]
        self._information += weighted.T @ block
        self._coloured_information += (block / coloured[:, None]).T @ block
        self._score += weighted.T @ innovation
        self._statistic += float(innovation @ (innovation / variance))
        if self.hits < self.HITS:
            return None
        change = np.asarray(np.linalg.solve(self._information + self._prior_information, self._score))
        explained = float(change @ self._score) / self._statistic
        significance = float(change @ self._coloured_information @ change)
        self._clear()
        large = bool(np.any(np.abs(change) > self.rule.least))
        return change if explained >= self.EXPLAINED and significance >= self.SIGNIFICANT and large else None

    def _clear(self) -> None:
        size = len(self._prior_information)
        self.hits = 0
        self._information = np.zeros((size, size))
        self._coloured_information = np.zeros((size, size))
        self._score = np.zeros(size)
        self._statistic = 0.0
