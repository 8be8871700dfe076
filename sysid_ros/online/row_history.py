"""RowHistory: the last moments before the low-pass, so that rows can be made again without what came before a change."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray
from sysid_ros.signals.low_pass import LowPassBank

_SPAN = 4.0
"""How far back it reaches, in periods of the cut-off."""
_STEP = 0.05
"""Between the times at which a change is looked for [periods of the cut-off]."""
_RISE = 0.5
"""For so long after a change w rises [periods of the cut-off]."""
_NEWEST = 3
"""A change is at least so many steps old."""


class RowHistory:
    """A low-pass remembers what was before a change for an eighth of a second and more. It is linear, so that

        F(w tau) = F(w Y) theta + F(w e),    w = 0 before the change and 1 after it,

    holds as the equation without w does, and holds nothing of the time before (Willsky, Jones 1976 find a change so; here it is
    also what the estimate starts anew from).

    Args:
        empty: channels of nothing, shape (n, c). block: columns of the parameters that change. period: of the measurements [s].
        bank: the low-pass.

    Attributes:
        ring, size, count: the channels before the low-pass, of which the newest ``size`` stand in the ring, shape (size, n, c),
            each at its number modulo ``size``; whoever pushes them writes there. samples: when they were taken [s], and where a
            row was due the q, v, a, tau of it, shape (4, n).
        updates: Y, y and what is considered of the rows that were due, after the low-pass.
        rise: w after a change, as a factor on each of the samples after it, the last one for all to come.
    """

    def __init__(self, empty: FloatArray, block: slice, period: float, bank: LowPassBank) -> None:
        own = 1.0 / (bank.cutoff_hz * period)
        self.size, self._block, self._sections = max(round(_SPAN * own), 8), block, bank.sections
        self._bank = bank
        self.ring = np.tile(empty, (self.size, 1, 1))
        self.samples: deque[tuple[float, FloatArray | None]] = deque(maxlen=self.size)
        self.updates: deque[tuple[FloatArray, FloatArray, FloatArray]] = deque(maxlen=self.size)
        self.count, self._step = 0, max(round(_STEP * own), 1)
        rise = (np.arange(round(_RISE * own) + 1) + 0.5) / (_RISE * own)
        self.rise: FloatArray = 0.5 - 0.5 * np.cos(np.pi * np.minimum(rise, 1.0))

    def clear(self) -> None:
        """Nothing of what has been is looked at again."""
        self.samples.clear()
        self.updates.clear()

    def settle(self, mean: FloatArray, root: FloatArray, matrix: FloatArray) -> None:
        """As of :meth:`.ArmRows.settle_links`; ``matrix``: that of :meth:`.LowPassBank.mix`."""
        self.ring = self.ring @ matrix
        rows = [(Y, y, np.hstack([Y[:, self._block], Z])) for Y, y, Z in self.updates]
        self.updates.clear()
        self.updates.extend((Y, y - known @ mean, known @ root) for Y, y, known in rows)

    def onset(self, theta: FloatArray, variance: FloatArray, prior_variance: FloatArray) -> int:
        """Index, in what is kept, of the first channels after the change that explains the newest rows best.

        Args:
            theta: parameters before it, shape (p,). variance: of a single row, shape (m,).
            prior_variance: of the block, shape (b,).
        """
        kept = len(self.samples)
        due = np.array([k for k, (_, sampled) in enumerate(self.samples) if sampled is not None], dtype=np.int64)
        rows = list(self.updates)[-due.size :]
        due = due[due.size - len(rows) :]
        e = np.array([y - Y @ theta for Y, y, _ in rows])
        raw = np.ascontiguousarray(self._recent()[:, :, self._block])
        starts = np.arange(kept - _NEWEST * self._step, 0, -self._step)
        if starts.size == 0:  # too little is kept to tell: all of it
            return 0
        gains = np.empty(starts.size)
        for i, start in enumerate(starts):
            columns = _windowed(raw, self._sections, start, due)
            weighted = columns / variance[:, None]
            information = np.einsum("kma,kmb->ab", weighted, columns) + np.diag(1.0 / prior_variance)
            score = np.einsum("kma,km->a", weighted, e)
            gains[i] = score @ np.linalg.solve(information, score)
        return int(starts[int(np.argmax(gains))]) + self._step

    def replay(self, first: int) -> Iterator[tuple[float, FloatArray]]:
        """Let the low-pass, from rest, take in ``w`` times the channels since an index; when and at what motion a row is due.

        w rises smoothly: where second differences of noisy positions were cut off, their noise would no longer cancel.
        """
        recent = self._recent()[first:]
        for _ in range(first):
            self.samples.popleft()
        beginning = min(len(recent), self.rise.size)
        recent[:beginning] *= self.rise[:beginning, None, None]
        self._bank.rest()
        for raw, (t, sampled) in zip(recent, list(self.samples), strict=True):
            self._bank.push(raw)
            if sampled is not None:
                yield float(t), sampled

    def _recent(self) -> FloatArray:
        kept = len(self.samples)
        return self.ring[np.arange(self.count - kept, self.count) % self.size]


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _windowed(raw: FloatArray, sections: FloatArray, start: int, due: FloatArray) -> FloatArray:
    """Channels (N, m, b) through the low-pass from rest, zero before ``start``, at the indices ``due`` (k,): shape (k, m, b)."""
    N, m, b = raw.shape
    state = np.zeros((sections.shape[0], 2, m, b))
    out = np.zeros((due.size, m, b))
    at = 0
    while at < due.size and due[at] < start:
        at += 1
    for k in range(start, N):
        for i in range(m):
            for j in range(b):
                u = raw[k, i, j]
                for s in range(sections.shape[0]):
                    y = sections[s, 0] * u + state[s, 0, i, j]
                    state[s, 0, i, j] = sections[s, 1] * u - sections[s, 4] * y + state[s, 1, i, j]
                    state[s, 1, i, j] = sections[s, 2] * u - sections[s, 5] * y
                    u = y
                if at < due.size and due[at] == k:
                    out[at, i, j] = u
        if at < due.size and due[at] == k:
            at += 1
    return out
