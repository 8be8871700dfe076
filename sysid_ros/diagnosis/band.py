"""Band: rows of recordings in the frequency domain, in which noise of any colour has (nearly) independent entries.

Each segment of a motion goes through the orthonormal cosine transform (type II); coefficients below a cut-off are kept:
an ideal low-pass, the same on torque and columns. Stationary noise of spectral density S(f) gives uncorrelated coefficients of
variance S(f_k) (Whittle 1953), so coloured noise needs a weight a coefficient and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import fft, sparse

from sysid_ros.effects import Motion
from sysid_ros.sample import FloatArray
from sysid_ros.signals.whittle import Bins, Noise

CUTOFF = 8.0
"""Upper end of the band that is judged [Hz]."""
_SEGMENT = 7.0
"""Usual length of a segment [s]."""
_STANDS, _STANDS_SLIDE = 0.015, 0.004
"""Speeds below which dry friction leaves the torque undetermined [rad/s], [m/s]."""
_ANCHOR = 0.15
"""Longest stretch of motion whose mean a bridge ends at [s]; shorter stretches count as rest."""
_FADES = 8.0 / 3.0
"""Time over which such a line fades, of that of its mean: the square of what is left of it then adds up to that mean's time."""
_FEWEST = 0.05
"""Part of the time that a joint must move to be judged."""


class RowNoise(Protocol):
    """Noise of rows."""

    def along(self, band: Band) -> FloatArray:
        """Variance of each coefficient of a band if its joints always moved, shape (K, n)."""

    @property
    def at_zero(self) -> FloatArray:
        """Variance of a coefficient at the frequency zero, shape (n,)."""


class Band:
    """Rows of several motions in the frequency domain, segment after segment.

    Where a joint stands, dry friction leaves its torque undetermined: torque and columns are bridged there by the same straight
    line. (A weight of zero would spread slow noise over all frequencies, and with it every slow column.) A line ends at
    weighted means over a short while of motion on both sides: fast noise of one instant would else stand for all of a rest. Over
    a longer rest the line fades from both sides, so that each end weighs about what its mean does; and the rows of a joint count
    as many as those of the time in which it moves.

    Args:
        motions: recordings without gaps.
        active: joints whose rows are to be judged where no rest leaves them undetermined, shape (n,), bool, as of a robot on
            legs, see :mod:`.legs.leg_rows`; None: those that move enough.
        cutoff: upper end of the band [Hz].
        noise: of rows of a band, shape (K, n), what makes them the likeliest; None: one colour for all, :class:`.Noise`.
        mixed: what the first rows of each motion are multiplied by, shape (m, m) each; None: nothing.
        usable: where the rows of ``active`` may be used, shape (N, n) of each motion; None: always.
        silent: indices of joints whose efforts hold nothing of their torque; they count as joints that stand.

    Attributes:
        f: frequency of each coefficient, shape (K,) [Hz]. segment: which segment it belongs to, shape (K,).
        moving: a motion, shape (N, n) each, bool.
        moves: part of the time that each joint moves, shape (n,). counted: part of its rows that are independent, shape (n,).
        active: joints that move enough to be judged, shape (n,).
        seconds: time that the rows cover [s]. silent: as above.
    """

    def __init__(
        self,
        motions: Sequence[Motion],
        active: NDArray[np.bool_] | None = None,
        cutoff: float = CUTOFF,
        usable: Sequence[NDArray[np.bool_]] | None = None,
        noise: Callable[[Band, FloatArray], RowNoise] | None = None,
        mixed: Sequence[FloatArray] | None = None,
        silent: Sequence[int] = (),
    ) -> None:
        self.motions, self._noise, self._mixed, self.silent = tuple(motions), noise, mixed, tuple(silent)
        robot = self.motions[0].robot
        self.n = robot.n
        stands = np.where(robot.is_prismatic, _STANDS_SLIDE, _STANDS)
        if active is None:
            self.moving = [_without_twitches(np.abs(m.v) > stands, m.period) for m in self.motions]
        else:
            self.moving = list(usable or (np.ones(m.v.shape, dtype=np.bool_) for m in self.motions))
        for moving in self.moving:
            moving[:, list(silent)] = False
        self.moves = np.mean(np.concatenate(self.moving), axis=0)
        self.active = self.moves > _FEWEST if active is None else active
        self._fades = active is None
        self.counted: FloatArray = np.maximum(self.moves, _FEWEST) if self._fades else np.ones(self.n)
        self._bridges = [
            [_Bridge(moving[:, j], round(_ANCHOR / m.period), fades=self._fades) for j in range(self.n)]
            for m, moving in zip(self.motions, self.moving, strict=True)
        ]
        self.slices: list[tuple[int, slice, int]] = []
        f, segment = [], []
        for i, motion in enumerate(self.motions):
            length = len(motion.t) * motion.period
            edges = np.linspace(0, len(motion.t), max(1, round(length / _SEGMENT)) + 1).astype(int)
            if len(edges) == 2 and len(self.motions) == 1 and length > 3.0:
                edges = np.array([0, len(motion.t) // 2, len(motion.t)])
            for a, end in pairwise(edges):
                b = a + _quick(int(end - a))
                seconds = (b - a) * motion.period
                count = int(min(2.0 * cutoff, 0.8 / motion.period) * seconds)
                f.append(np.arange(count) / (2.0 * seconds))
                segment.append(np.full(count, len(self.slices)))
                self.slices.append((i, slice(int(a), int(b)), count))
        self.f: FloatArray = np.concatenate(f)
        self._bins = Bins.of(self.f)
        self.segment = np.concatenate(segment)
        self.seconds = sum(len(m.t) * m.period for m in self.motions)

    @property
    def segments(self) -> int:
        """Number of segments."""
        return len(self.slices)

    def rows(self, values: Sequence[FloatArray]) -> FloatArray:
        """Coefficients, shape (K, n, ...), of values on the grids of the motions, shape (N, n, ...) each."""
        bridged = [self._bridged(i, x) for i, x in enumerate(values)]
        rows = np.concatenate([fft.dct(bridged[i][where], axis=0, norm="ortho")[:count] for i, where, count in self.slices])
        return rows if self._mixed is None else self._multiplied(rows, self._mixed)

    def counted_in(self, i: int, where: slice, parts: int) -> list[FloatArray]:
        """What :attr:`counted` is in each of several equal parts of a segment, shape (n,) each. Args: i: its motion."""
        moving = np.array_split(self.moving[i][where], parts) if self._fades else [np.ones((1, self.n))] * parts
        return [np.mean(x, axis=0) for x in moving]

    def unmixed(self, rows: FloatArray) -> FloatArray:
        """Rows of shape (K, n) before they were multiplied."""
        return rows if self._mixed is None else self._multiplied(rows, [np.asarray(np.linalg.inv(m)) for m in self._mixed])

    def unmixed_variance(self, variance: FloatArray) -> FloatArray:
        """Variance of those rows where those of the band have errors of their own, shape (K, n)."""
        return (
            variance
            if self._mixed is None
            else self._multiplied(variance, [np.asarray(np.linalg.inv(m) ** 2) for m in self._mixed])
        )

    def _multiplied(self, rows: FloatArray, by: Sequence[FloatArray]) -> FloatArray:
        out, begin = rows.copy(), 0
        for i, _, count in self.slices:
            part, size = slice(begin, begin + count), len(by[i])
            begin += count
            out[part, :size] = np.einsum("ij,kj...->ki...", by[i], rows[part, :size], optimize=True)
        return out

    def _bridged(self, i: int, values: FloatArray) -> FloatArray:
        out = np.array(values)
        for j, bridge in enumerate(self._bridges[i]):
            if len(bridge.gap):
                out[bridge.gap, j] = bridge.over(values[:, j])
        return out

    def noise_of(self, rows: FloatArray) -> RowNoise:
        """The noise that makes what is left of the rows, shape (K, n), the most likely."""
        return self._noise(self, rows) if self._noise else Noise.in_bins(self._bins, rows**2 / self.counted)

    def curves(self, values: Sequence[FloatArray]) -> FloatArray:
        """Coefficients, shape (c, K, n), of curves on the grids, shape (c, N, n) each."""
        return np.moveaxis(self.rows([np.moveaxis(v, 0, -1) for v in values]), -1, 0)

    def joint_curves(self, joint: int, values: Sequence[FloatArray]) -> FloatArray:
        """Coefficients, shape (K, c), of curves of one joint on the grids, shape (c, N) each."""
        bridged = [np.array(x) for x in values]
        for y, bridges in zip(bridged, self._bridges, strict=True):
            if len(bridges[joint].gap):
                y[:, bridges[joint].gap] = bridges[joint].over(y.T).T
        parts = [fft.dct(bridged[i][:, where], axis=1, norm="ortho")[:, :count].T for i, where, count in self.slices]
        return np.concatenate(parts)


class _Bridge:
    """Straight lines over the rests of one joint.

    Args:
        moving: shape (N,). reach: most samples that an end of a line is the mean of. fades: whether lines do that are longer than
            what their ends are the means of.

    Attributes:
        gap: indices where the joint stands, shape (G,).
    """

    def __init__(self, moving: NDArray[np.bool_], reach: int, fades: bool) -> None:
        runs = _runs(moving)
        self.gap = np.flatnonzero(~moving)
        rows: list[tuple[NDArray[np.intp], FloatArray]] = []
        before, after, part, level = (np.zeros(len(moving), dtype=x) for x in (np.intp, np.intp, float, float))
        for k, (a, b) in enumerate(runs):
            if moving[a]:
                continue
            ends = [(max(runs[k - 1][0], a - reach), a)] if k > 0 else []
            ends += [(b, min(runs[k + 1][1], b + reach))] if k + 1 < len(runs) else []
            before[a:b], after[a:b] = len(rows), len(rows) + len(ends) - 1
            part[a:b] = np.arange(1, b - a + 1) / (b - a + 1.0)
            away = np.arange(b - a) + 0.5
            nearest = np.min(
                [x for x, there in ((away, k > 0), (away[::-1], k + 1 < len(runs))) if there or len(runs) == 1], axis=0
            )
            long = fades and b - a > 2 * reach
            level[a:b] = np.cos(0.5 * np.pi * np.minimum(nearest / (_FADES * reach), 1.0)) ** 2 if long else 1.0
            for first, last in ends or [(a, b)]:
                bell = np.sin(np.pi * np.arange(1, last - first + 1) / (last - first + 1.0)) ** 2
                rows.append((np.arange(first, last), bell / bell.sum()))
        at = np.concatenate([np.zeros(0, dtype=np.intp), *(x for x, _ in rows)])
        weights = np.concatenate([np.zeros(0), *(x for _, x in rows)])
        begin = np.cumsum([0, *(len(x) for x, _ in rows)])
        self._means = sparse.csr_array((weights, at, begin), shape=(len(rows), len(moving)))
        self._before, self._after, self._part, self._level = (x[self.gap] for x in (before, after, part, level))

    def over(self, values: FloatArray) -> FloatArray:
        """What stands in the gap for values of shape (N, ...), shape (G, ...)."""
        ends = (self._means @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])
        part, level = (x.reshape((-1,) + (1,) * (values.ndim - 1)) for x in (self._part, self._level))
        bridged: FloatArray = level * ((1.0 - part) * ends[self._before] + part * ends[self._after])
        return bridged


def _quick(length: int) -> int:
    """The next shorter length whose transform is quick: a few samples less, and several times the speed."""
    while fft.next_fast_len(length, real=True) != length:
        length -= 1
    return length


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last-but-one index of each stretch of equal flags."""
    cuts = np.flatnonzero(np.diff(flags)) + 1
    return list(pairwise([0, *(int(c) for c in cuts), len(flags)]))


def _without_twitches(moving: NDArray[np.bool_], period: float) -> NDArray[np.bool_]:
    """The same without stretches of motion that are too short to be judged, shape (N, n)."""
    out = moving.copy()
    for j in range(moving.shape[1]):
        for a, b in _runs(moving[:, j]):
            if moving[a, j] and (b - a) * period < _ANCHOR:
                out[a:b, j] = False
    return out
