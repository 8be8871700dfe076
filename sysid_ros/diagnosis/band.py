"""Band: rows of recordings in the frequency domain, in which noise of any colour has (nearly) independent entries.

Each segment of a motion goes through the orthonormal cosine transform (type II); coefficients below a cut-off are kept:
an ideal low-pass, the same on torque and columns. Stationary noise of spectral density S(f) gives uncorrelated coefficients of
variance S(f_k) (Whittle 1953), so coloured noise needs a weight a coefficient and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from sysid_ros.effects import Motion
from sysid_ros.sample import FloatArray

CUTOFF = 8.0
"""Upper end of the band that is judged [Hz]."""
_SEGMENT = 7.0
"""Usual length of a segment [s]."""
_STANDS, _STANDS_SLIDE = 0.015, 0.004
"""Speeds below which dry friction leaves the torque undetermined [rad/s], [m/s]."""
_FEWEST = 0.05
"""Part of the time that a joint must move to be judged."""


class Band:
    """Rows of several motions in the frequency domain, segment after segment.

    Where a joint stands, dry friction leaves its torque undetermined: torque and columns are bridged there by the same straight
    line. (A weight of zero would spread slow noise over all frequencies, together with every slow column.)

    Args:
        motions: recordings without gaps.

    Attributes:
        f: frequency of each coefficient, shape (K,) [Hz]. segment: which segment it belongs to, shape (K,).
        moving: a motion, shape (N, n) each, bool.
        active: joints that move enough to be judged, shape (n,).
        seconds: time that the rows cover [s].
    """

    def __init__(self, motions: Sequence[Motion]) -> None:
        self.motions = tuple(motions)
        robot = self.motions[0].robot
        self.n = robot.n
        stands = np.where(robot.is_prismatic, _STANDS_SLIDE, _STANDS)
        self.moving = [np.abs(m.v) > stands for m in self.motions]
        self.active = np.mean(np.concatenate(self.moving), axis=0) > _FEWEST
        self._bridges = [[_bridge(moving[:, j]) for j in range(self.n)] for moving in self.moving]
        self.slices: list[tuple[int, slice, int]] = []
        f, segment = [], []
        for i, motion in enumerate(self.motions):
            length = len(motion.t) * motion.period
            edges = np.linspace(0, len(motion.t), max(1, round(length / _SEGMENT)) + 1).astype(int)
            if len(edges) == 2 and len(self.motions) == 1 and length > 3.0:
                edges = np.array([0, len(motion.t) // 2, len(motion.t)])
            for a, b in pairwise(edges):
                seconds = (b - a) * motion.period
                count = int(min(2.0 * CUTOFF, 0.8 / motion.period) * seconds)
                f.append(np.arange(count) / (2.0 * seconds))
                segment.append(np.full(count, len(self.slices)))
                self.slices.append((i, slice(int(a), int(b)), count))
        self.f: FloatArray = np.concatenate(f)
        self.segment = np.concatenate(segment)
        self.seconds = sum(len(m.t) * m.period for m in self.motions)

    @property
    def segments(self) -> int:
        """Number of segments."""
        return len(self.slices)

    def rows(self, values: Sequence[FloatArray]) -> FloatArray:
        """Coefficients, shape (K, n, ...), of values on the grids of the motions, shape (N, n, ...) each."""
        out = []
        bridged = [self._bridged(i, x) for i, x in enumerate(values)]
        for i, where, count in self.slices:
            out.append(fft.dct(bridged[i][where], axis=0, norm="ortho")[:count])
        return np.concatenate(out)

    def _bridged(self, i: int, values: FloatArray) -> FloatArray:
        out = np.array(values)
        for j, (gap, left, right, part) in enumerate(self._bridges[i]):
            share = part.reshape((-1,) + (1,) * (values.ndim - 2))
            out[gap, j] = (1.0 - share) * values[left, j] + share * values[right, j]
        return out

    def curves(self, values: Sequence[FloatArray]) -> FloatArray:
        """Coefficients, shape (c, K, n), of curves on the grids, shape (c, N, n) each."""
        return np.moveaxis(self.rows([np.moveaxis(v, 0, -1) for v in values]), -1, 0)

    def joint_curves(self, joint: int, values: Sequence[FloatArray]) -> FloatArray:
        """Coefficients, shape (K, c), of curves of one joint on the grids, shape (c, N) each."""
        out = []
        bridged = []
        for i, x in enumerate(values):
            gap, left, right, part = self._bridges[i][joint]
            y = np.array(x)
            y[:, gap] = (1.0 - part) * x[:, left] + part * x[:, right]
            bridged.append(y)
        for i, where, count in self.slices:
            out.append(fft.dct(bridged[i][:, where], axis=1, norm="ortho")[:, :count].T)
        return np.concatenate(out)


_Bridge = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], FloatArray]


def _bridge(moving: NDArray[np.bool_]) -> _Bridge:
    """Indices where a joint stands, the last and the next index at which it moves, and how far between the two."""
    there = np.flatnonzero(moving)
    gap = np.flatnonzero(~moving)
    if not there.size:
        return gap, gap, gap, np.zeros(gap.size)
    after = np.searchsorted(there, gap)
    left = there[np.maximum(after - 1, 0)]
    right = there[np.minimum(after, there.size - 1)]
    left = np.where(after == 0, right, left)
    width = np.maximum(right - left, 1)
    return gap, left, right, np.clip((gap - left) / width, 0.0, 1.0)
