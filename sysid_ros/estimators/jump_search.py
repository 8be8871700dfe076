"""JumpSearch: a change of the parameters, found from the innovations."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy import special

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class JumpRule:
    """Which parameters may jump, and what counts as a jump.

    Attributes:
        block: the parameters that may jump.
        least: change of the block's parameters of which one must be exceeded, shape (size of block,); infinite where it does
            not count.
        memory: time after a jump during which old data are still in the rows [s]; 0 where whoever gives the rows takes care of
            it: with the row that shows the jump the estimator goes back to before the run that it ends, and is left so; who calls
            may let it :meth:`.Estimator.forget`, and gives it rows that hold nothing of the time before.
        lasts: a jump must explain rows of twice this time, see :class:`.LastingJumpSearch` [s]; 0: a run of a few rows.
    """

    block: slice
    least: FloatArray
    memory: float
    lasts: float = 0.0


class JumpSearch:
    """A run of innovations that are too large for what is known, of which the newest are fitted with a jump of the parameters
    that may jump (Willsky, Jones 1976).

    Args:
        rule: which parameters, and what counts. prior_variance: of all parameters, shape (p,).

    Attributes:
        hits: innovations in the run so far. misfits: the last of them without a break that noise, as well as it is known, would
            not explain once in a million.
    """

    HITS = 5
    EXPLAINED = 0.8
    SIGNIFICANT = 25.0

    def __init__(self, rule: JumpRule, prior_variance: FloatArray) -> None:
        self.rule = rule
        self._prior_information = np.diag(1.0 / prior_variance[rule.block])
        self.misfits = 0
        self._clear()

    def miss(self) -> None:
        """An innovation that fits what is known."""
        self.misfits = 0
        self.hits -= 1
        if self.hits <= 0:
            self._clear()

    def weigh(self, z: float, m: int, independent: float) -> None:
        """The normalised innovation z of the m rows to come in :meth:`hit`; noise is known from so many independent values."""
        unlikely = z > special.fdtri(m, max(independent, 1.0), 1.0 - 1e-6)
        self.misfits = self.misfits + 1 if unlikely else 0

    def hit(self, Y: FloatArray, innovation: FloatArray, variance: FloatArray, coloured: FloatArray) -> FloatArray | None:
        """An innovation that does not fit: the change of the block that explains the run, once it is long enough.

        Args:
            Y: shape (m, p). innovation: shape (m,). variance, coloured: of a single row, and over a long run, shape (m,).
        """
        self.hits += 1
        block = Y[:, self.rule.block]
        weighted = block / variance[:, None]
        coloured_information = (block / coloured[:, None]).T @ block
        statistic = float(innovation @ (innovation / variance))
        self._run.append((weighted.T @ block, coloured_information, weighted.T @ innovation, statistic))
        if not self.HITS <= self.hits <= 2 * self.HITS:  # a run that goes on is no jump
            return None
        information, coloured_sum, score = (sum(parts) for parts in list(zip(*self._run, strict=True))[:3])
        change = np.asarray(np.linalg.solve(information + self._prior_information, score))
        explained = float(change @ score) / sum(part[3] for part in self._run)
        significance = float(change @ coloured_sum @ change)
        large = bool(np.any(np.abs(change) > self.rule.least))
        if explained < self.EXPLAINED or significance < self.SIGNIFICANT or not large:
            return None
        self._clear()
        return change

    def _clear(self) -> None:
        self.hits = 0
        self._run: deque[tuple[FloatArray, FloatArray, FloatArray, float]] = deque(maxlen=self.HITS)
