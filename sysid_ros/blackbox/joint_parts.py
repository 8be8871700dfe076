"""What is left of one joint's torque as a sum of parts: what it predicts of left-out data, and how large what a model lacks is.

The parts are independent and normal, and their sizes are those of the largest restricted likelihood: functions of the motion, one
part a kind, with random coefficients (what a ridge regression assumes); white noise; noise that is remembered for some time; and
what comes with the motion without being any of these functions (a ringing, a rattle), as far as it is absent while the robot
stands. There the torque has noise and, for dry friction, an unknown constant, and nothing else. A ridge predicts too little of
what is there, as it shrinks; the power of the parts of noise has no such bias, and an interval.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.blackbox.rest_features import Blocks
from sysid_ros.blackbox.variance_components import NOTHING, VarianceComponents
from sysid_ros.sample import FloatArray

_MOST_ROWS = 420
"""Rows of which the covariance is inverted, which takes the cube of their number: some 20 s below 8 Hz."""
_FEW_ROWS = 200
"""Rows that are enough for sizes with which only to predict: an error of a size costs its square."""
_MEMORIES = (0.3, 2.0)
"""Times for which slow noise is remembered [s]: longer ones are a constant of a few stretches, shorter ones white."""
_BANDS = 6
"""Bands below the cut-off in which there may be what only comes with the motion."""
_HIGHEST = 100.0
"""Highest ripple that is searched for [1/rad]: what passes faster at the slowest usual speed is above the cut-off."""
_MOST_RIPPLES = 3
_START = 0.2
"""Size with which a further part begins to be fitted, of the power: none of those that were found ends at once."""
_AGAIN = 0.01
"""The same for noise: an amplitude of a tenth, from which it grows or falls to nothing within the first steps."""
_NORMAL = 1.96


@dataclass(frozen=True, eq=False)
class JointRest:
    """What is left of one joint's torque, and what may be known of it.

    Attributes:
        y: shape (N,) [N m]. t: [s]. stretch: number of the recording's stretch, shape (N,). moving: where the joint moves.
        stands: number of the standstill of all joints, 0 where one moves, shape (N,). block: rows of one are kept together.
        functions: by kind, shape (N, c) each. harmonics: from k, shape (m,), to sines and cosines of k times the position, shape
            (N, 2 m). turn: step and end of k at which ripples are searched for.
        cutoff: of all channels [Hz]. white: lags [s], and how much of white noise is alike at them below the cut-off, shape (l,)
            each.
    """

    y: FloatArray
    t: FloatArray
    stretch: NDArray[np.intp]
    moving: NDArray[np.bool_]
    stands: NDArray[np.intp]
    block: NDArray[np.intp]
    functions: Blocks
    harmonics: Callable[[FloatArray], FloatArray]
    turn: tuple[float, float]
    cutoff: float
    white: tuple[FloatArray, FloatArray]


def turns_of(q: FloatArray, unit: float) -> tuple[float, float]:
    """Step and end of the ripples that a range of positions, shape (N,), can tell from each other; unit: 1 rad, or what it is."""
    width = float(np.ptp(q)) / unit
    # half of the width of a peak of the spectrum
    return float(np.clip(np.pi / max(width, 1e-9), 0.25, 1.0)) / unit, _HIGHEST / unit


class JointParts:
    """The parts of one joint's rest.

    Args:
        rest: with rows in which the joint moves.
    """

    def __init__(self, rest: JointRest) -> None:
        self._rest, self._own = rest, _chosen(rest)
        self._moving = rest.moving[self._own]
        self._scale = max(float(np.sqrt(np.mean(rest.y[self._own][self._moving] ** 2))), 1e-300)
        self._y = rest.y[self._own] / self._scale
        stands = np.where(self._moving, 0, rest.stands[self._own])
        free = [self._moving, *(stands == k for k in np.unique(stands[stands > 0]))]
        self._F = np.column_stack(free).astype(float)
        t, stretch = rest.t[self._own], rest.stretch[self._own]
        self._dt, self._same = np.abs(t[:, None] - t), stretch[:, None] == stretch
        self._noise = self._of_noise()
        self._functions = [self._alike(x) for x in rest.functions.values()]
        self._kernels = [*self._noise, *(Z[self._own] @ Z[self._own].T for Z in self._functions)]

    def left_out(self, fold: NDArray[np.intp]) -> FloatArray:
        """What the functions of the motion predict of each fold, sizes and coefficients from the others, shape (N,) [N m]."""
        out = np.zeros(len(self._rest.y))
        for f in np.unique(fold):
            used = np.flatnonzero(fold[self._own] != f)
            sizes = self._sizes(used)
            told = np.flatnonzero(sizes)
            found = VarianceComponents.of(*self._rows(used, told), sizes[told])
            weights = found.weights
            explained = found.covariance(range(len(told))) @ weights
            level = np.linalg.lstsq(self._F[used], self._y[used] - explained, rcond=None)[0][0]
            rows, total = fold == f, np.full(int(np.sum(fold == f)), level)
            for s, Z in zip(sizes[len(self._noise) :], self._functions, strict=True):
                if s > 0.0:
                    total += Z[rows] @ (s * (Z[self._own[used]].T @ weights))
            # where a motion leaves what was fitted, functions of it run away
            known = self._y[used][self._moving[used]]
            out[rows] = np.clip(total, known.min(initial=0.0), known.max(initial=0.0))
        return self._scale * out

    def _rows(
        self, used: NDArray[np.intp], parts: NDArray[np.intp] | None = None
    ) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
        """Signal, free columns and kernels of some of the chosen rows, of some parts; None: of all."""
        F, square = self._F[used], np.ix_(used, used)
        kernels = self._kernels if parts is None else [self._kernels[k] for k in parts]
        return self._y[used], F[:, F.any(axis=0)], [K[square] for K in kernels]

    def _sizes(self, used: NDArray[np.intp]) -> FloatArray:
        """Of all parts, from every other block of some of the chosen rows where these are many."""
        block = self._rest.block[self._own[used]]
        few = np.isin(block, np.unique(block)[::2]) if len(used) > _FEW_ROWS else np.ones(len(used), dtype=bool)
        return VarianceComponents.fitted(*self._rows(used[few])).sizes

    def noise(self) -> tuple[float, tuple[float, float]]:
        """rms of what no function of the motion makes while the joint moves, and its 95 % interval [N m]."""
        found = self._with_bands(self._with_ripples(VarianceComponents.fitted(self._y, self._F, self._kernels)))
        each, std = found.power(range(len(self._noise)), self._moving)
        power = float(np.mean(each))
        std = float(np.sqrt(std**2 + self._of_blocks(each - power) + self._of_others(found) + NOTHING**2))
        ends = [self._scale * float(np.sqrt(max(power + k * std, 0.0))) for k in (-_NORMAL, _NORMAL)]
        return self._scale * float(np.sqrt(max(power, 0.0))), (ends[0], ends[1])

    def _of_blocks(self, off: FloatArray) -> float:
        """Variance of a mean over the rows in which the joint moves, from what blocks differ by: noise may not be the same
        everywhere, and functions may be missing among the parts."""
        number = np.unique(self._rest.block[self._own][self._moving], return_inverse=True)[1]
        return float(np.sum((np.bincount(number, off) / len(off)) ** 2))

    def _of_others(self, found: VarianceComponents) -> float:
        """Variance of the power of all rows in which the joint moves about that of the chosen ones, as the others have noise of
        their own."""
        count = int(self._moving.sum())
        others = int(self._rest.moving.sum()) - count
        if not others:
            return 0.0
        E = found.covariance(range(len(self._noise)))[np.ix_(self._moving, self._moving)]
        of_chosen = 2.0 * float(np.sum(E**2)) / count**2
        return (others / (others + count)) ** 2 * of_chosen * (1.0 + count / others)

    def _alike(self, X: FloatArray) -> FloatArray:
        """Columns of the same size while the joint moves, whose sum has power 1 then, shape (N, c)."""
        own = X[self._own][self._moving]
        mean, size = own.mean(axis=0), own.std(axis=0)
        told = size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300)
        return np.asarray((X - mean)[:, told] / (size[told] * np.sqrt(max(int(told.sum()), 1))))

    def _of_noise(self) -> list[FloatArray]:
        """Slow noise, which does not know whether the joint moves, and white noise, which may: that of drives grows with work."""
        out = [np.where(self._same, np.exp(-self._dt / memory), 0.0) for memory in _MEMORIES]
        white = np.where(self._same, np.interp(self._dt, *self._rest.white, right=0.0), 0.0)
        out += [white * np.outer(x, x) for x in (self._moving, ~self._moving)]
        return out if not self._moving.all() else out[:-1]

    def _with_ripples(self, found: VarianceComponents) -> VarianceComponents:
        """With ripples of the harmonics that make the data likelier than the number of harmonics to choose from."""
        step, end = self._rest.turn
        k = np.arange(step, end + 0.5 * step, step)
        columns = self._rest.harmonics(k)[self._own]
        sin, cos = columns[:, : len(k)], columns[:, len(k) :]
        for _ in range(_MOST_RIPPLES):
            saved = (sin.T @ found.weights) ** 2 + (cos.T @ found.weights) ** 2
            usual = np.einsum("ij,ij->j", sin, found.P @ sin) + np.einsum("ij,ij->j", cos, found.P @ cos)
            ratio = np.maximum(saved / np.maximum(usual, 1e-9 * float(usual.max())), 1.0)
            gain = ratio - 1.0 - np.log(ratio)
            best = int(np.argmax(gain))
            pair = np.column_stack([sin[:, best], cos[:, best]])
            K = pair @ pair.T / max(float(np.mean(pair[self._moving] ** 2)) * 2.0, 1e-300)
            more = self._more(found, K, float(gain[best]), len(k))
            if more is None:
                break
            found = more
        return found

    def _with_bands(self, found: VarianceComponents) -> VarianceComponents:
        """With what lies in one band and is there while the joint moves alone, for bands in which the data are likelier with it
        than there are bands to choose from; none where no standstill tells it from noise."""
        if self._moving.all():
            return found
        width = self._rest.cutoff / _BANDS
        # bands of normal shape: those of a decay have tails that take white noise along
        decay = np.where(self._same & np.outer(self._moving, self._moving), np.exp(-0.5 * (np.pi * width * self._dt) ** 2), 0.0)
        bands = [decay * np.cos(2.0 * np.pi * k * width * self._dt) for k in range(_BANDS)]
        for _ in range(_BANDS):
            gain = [found.gained_by(K) for K in bands]
            best = int(np.argmax(gain))
            more = self._more(found, bands[best], gain[best], _BANDS)
            if more is None:
                break
            found = more
        return found

    def _more(self, found: VarianceComponents, K: FloatArray, gain: float, choices: int) -> VarianceComponents | None:
        """With one part more where it gains, by a first look and then truly, more log-likelihood than choosing it costs."""
        least = float(np.log(choices))
        if gain <= least:
            return None
        start = np.append(found.sizes, _START)
        # noise whose place another part had taken may come back
        start[: len(self._noise)] = np.maximum(start[: len(self._noise)], _AGAIN)
        more = VarianceComponents.fitted(self._y, self._F, [*found.kernels, K], start)
        return more if more.log_likelihood - found.log_likelihood > least else None


def _chosen(rest: JointRest) -> NDArray[np.intp]:
    """Rows in which the joint moves or the robot stands, of as many blocks as are not too many, evenly."""
    own = rest.moving | (rest.stands > 0)
    blocks = np.unique(rest.block[own])
    count = min(len(blocks), max(1, int(len(blocks) * _MOST_ROWS / max(int(own.sum()), 1))))
    kept = blocks[np.linspace(0, len(blocks) - 1, count).round().astype(int)]
    return np.flatnonzero(own & np.isin(rest.block, kept))
