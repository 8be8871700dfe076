"""The ceiling: how much of the torque that a physical model leaves could any model explain, on which joint, where and with what.

For each joint five black boxes predict the residual of stretches that they were not fitted to. Which box and which ridge counts
for a stretch is decided by the other stretches alone, among them a box that predicts nothing, so that having had a choice gains
nothing. The gain is a sum over blocks of time; its standard error is that of the blocks, and it is claimed where chance is
left less than 5 % for all joints together (Bonferroni), by the stronger of two tests of the blocks: Student's t with Hall's
correction for their skewness, as few blocks may hold most of a gain, and Wilcoxon's signed ranks. The interval is Hall's too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sysid_ros.blackbox.ceiling_result import Ceiling, JointCeiling
from sysid_ros.blackbox.left_out_ridge import RIDGES, left_out
from sysid_ros.blackbox.rest_boxes import BOXES, Box, single_inputs
from sysid_ros.blackbox.rest_inputs import RestInputs, Spread, cutoff_of
from sysid_ros.blackbox.skewed_mean import SkewedMean
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.zero_phase import low_passed

_BLOCK = 1.5
"""Length of a block [s]: longer than slow noise is remembered by most joints."""
_FOLDS = 5
_FEWEST_BLOCKS = 6
"""Blocks below which no standard error is worth its name."""
_LEVEL = 0.05
_MOST_ROWS = 6000
"""Rows beyond which more tell nothing new, and cost time."""


def ceiling(
    names: Sequence[str], motions: Sequence[Motion], rest: Sequence[FloatArray], only: Sequence[int] | None = None
) -> Ceiling:
    """How much of a residual black boxes predict.

    Args:
        names: of joints. motions: without gaps. rest: measured less predicted torque on their grids, shape (N, n) each [N m].
        only: joints to judge; None: all.
    """
    cutoff = cutoff_of(motions)
    inputs = [RestInputs.of(m, cutoff) for m in motions]
    both = [
        [low_passed(x, cutoff, m.period) for x, m in zip(xs, motions, strict=True)] for xs in (rest, [m.tau for m in motions])
    ]
    rows = _Rows.of(inputs, both[0], both[1], max(1, -(-sum(len(i.t) for i in inputs) // _MOST_ROWS)))
    judged = range(len(names)) if only is None else only
    level = _LEVEL / max(len(judged), 1)
    joints = [_judge(rows, j, tuple(names), level) if j in judged else _unknown(name, rows, j) for j, name in enumerate(names)]
    # where a joint stands dry friction holds it, and no torque is due
    torque, left = (float(np.sqrt(np.mean(np.sum(np.where(rows.moving, x, 0.0) ** 2, axis=1)))) for x in (rows.tau, rows.rest))
    less = sum(_power_gained(j) * rows.moves(k) for k, j in enumerate(joints) if j.claimed)
    after = float(np.sqrt(max(left**2 - less, 0.0)))
    return Ceiling(tuple(joints), left / max(torque, 1e-12), (left - after) / max(torque, 1e-12), len(BOXES))


@dataclass(frozen=True, eq=False)
class _Rows:
    """All stretches in a row.

    Attributes:
        inputs: stretches. spread: of their channels. rest, tau: shape (N, n). moving: shape (N, n). block, fold: of each row.
        thin: every so many rows is used.
    """

    inputs: tuple[RestInputs, ...]
    spread: Spread
    rest: FloatArray
    tau: FloatArray
    moving: NDArray[np.bool_]
    block: NDArray[np.intp]
    fold: NDArray[np.intp]
    thin: int

    @classmethod
    def of(cls, inputs: Sequence[RestInputs], rest: Sequence[FloatArray], tau: Sequence[FloatArray], thin: int) -> _Rows:
        """Blocks never reach over the end of a stretch; a fold is blocks that follow each other."""
        numbers, start = [], 0
        for i in inputs:
            count = max(1, round(len(i.t) * i.period / _BLOCK))
            numbers.append(start + np.minimum(np.arange(len(i.t)) * count // max(len(i.t), 1), count - 1))
            start += count
        block = np.concatenate(numbers)
        fold = block * _FOLDS // max(start, 1)
        parts = [np.concatenate([x[:: i.every] for x, i in zip(xs, inputs, strict=True)]) for xs in (rest, tau)]
        moving = np.concatenate([i.moving for i in inputs])
        return cls(
            tuple(inputs),
            Spread.of(inputs),
            parts[0][::thin],
            parts[1][::thin],
            moving[::thin],
            block[::thin],
            fold[::thin],
            thin,
        )

    def columns(self, box: Box, joint: int) -> FloatArray:
        """Shape (N, c)."""
        return np.concatenate([box.columns(i, self.spread, joint) for i in self.inputs])[:: self.thin]

    def moves(self, joint: int) -> float:
        """Part of the rows in which a joint moves."""
        return float(np.mean(self.moving[:, joint]))


def _unknown(name: str, rows: _Rows, joint: int) -> JointCeiling:
    torque = float(np.sqrt(np.mean(rows.tau[:, joint] ** 2)))
    return JointCeiling(name, None, None, None, None, False, {}, 0, torque)


def _judge(rows: _Rows, j: int, names: tuple[str, ...], level: float) -> JointCeiling:
    own = rows.moving[:, j]
    block = rows.block[own]
    number = np.unique(block, return_inverse=True)[1]
    count = int(number.max(initial=-1)) + 1
    if count < _FEWEST_BLOCKS or len(np.unique(rows.fold[own])) < _FOLDS:
        return _unknown(names[j], rows, j)
    y, fold = rows.rest[own, j], rows.fold[own]
    torque = max(float(np.sqrt(np.mean(rows.tau[own, j] ** 2))), 1e-12)
    made = {box.name: left_out(rows.columns(box, j)[own], y, fold) for box in BOXES}
    every = np.column_stack([np.zeros(len(y)), *made.values()])
    gains = _by_block(y, every, number, count)
    chosen, best = _chosen(gains, np.array([fold[number == b][0] for b in range(count)]))
    gained = gains[np.arange(count), chosen]
    before = float(np.sqrt(np.mean(y**2)))
    gain, std, interval, p = _measured(gained, len(y), before)
    claimed = bool(p is not None and p < level and gain > 0.0)
    best_of = {
        name: float(part.sum(axis=0).max()) for name, part in zip(made, np.split(gains[:, 1:], len(made), axis=1), strict=True)
    }
    boxes = {name: _points(saved, len(y), before) / torque for name, saved in best_of.items()}
    found = JointCeiling(
        names[j],
        before / torque,
        gain / torque,
        std / torque,
        p,
        claimed,
        boxes,
        count,
        torque,
        interval=interval and (interval[0] / torque, interval[1] / torque),
        chosen=None if best == 0 else (BOXES[(best - 1) // len(RIDGES)].name, float(RIDGES[(best - 1) % len(RIDGES)])),
    )
    if not claimed:
        return found
    prediction = every[np.arange(len(y)), chosen[number]]
    return _described(found, rows, j, names, own, prediction, fold)


def _by_block(y: FloatArray, predictions: FloatArray, number: NDArray[np.intp], count: int) -> FloatArray:
    """Squared error that each prediction saves in each block, shape (count, predictions)."""
    saved = y[:, None] ** 2 - (y[:, None] - predictions) ** 2
    out = np.zeros((count, predictions.shape[1]))
    np.add.at(out, number, saved)
    return out


def _chosen(gains: FloatArray, fold: NDArray[np.intp]) -> tuple[NDArray[np.intp], int]:
    """For each block the prediction that saves most in the other folds, and the one that saves most in all."""
    total = gains.sum(axis=0)
    out = np.zeros(len(gains), dtype=np.intp)
    for f in np.unique(fold):
        out[fold == f] = int(np.argmax(total - gains[fold == f].sum(axis=0)))
    return out, int(np.argmax(total))


def _points(saved: float, rows: int, before: float) -> float:
    """By how much the rms falls from ``before`` where squared errors of so many rows fall by ``saved`` in all."""
    after = max(before**2 - saved / rows, 0.0) if saved > 0.0 else before**2 - saved / rows
    return before - float(np.sqrt(after))


def _measured(gained: FloatArray, rows: int, before: float) -> tuple[float, float, tuple[float, float] | None, float | None]:
    """Fall of the rms, its standard error, its 95 % interval, and the probability that chance makes so much."""
    count, total = len(gained), float(gained.sum())
    gain = _points(total, rows, before)
    error = float(np.sqrt(count) * np.std(gained, ddof=1))
    after = max(before - gain, 0.5 * before)
    std = error / rows / (before + after)
    if error <= 0.0:
        return gain, std, None, None
    mean = SkewedMean(gained)
    low, high = (_points(count * m, rows, before) for m in mean.interval())
    return gain, std, (low, high), _by_chance(gained, mean.by_chance())


def _by_chance(gained: FloatArray, of_mean: float) -> float:
    """Probability of so much gain, or more, where nothing is to be gained: the smaller one of two tests, for having had both.

    Args:
        gained: of blocks. of_mean: the same probability by their mean.
    """
    told = gained[gained != 0.0]
    ranks = float(stats.wilcoxon(told, alternative="greater").pvalue) if len(told) > 1 else 1.0
    return min(1.0, 2.0 * min(of_mean, ranks))


def _power_gained(j: JointCeiling) -> float:
    """Mean square that is gained while the joint moves [(N m)^2]."""
    assert j.left is not None
    assert j.gain is not None
    return float((j.left**2 - (j.left - j.gain) ** 2) * j.torque**2)


def _described(
    found: JointCeiling,
    rows: _Rows,
    j: int,
    names: tuple[str, ...],
    own: NDArray[np.bool_],
    prediction: FloatArray,
    fold: NDArray[np.intp],
) -> JointCeiling:
    """The same with its frequency and with what it follows."""
    y = rows.rest[own, j]
    saved = float(np.sum(y**2 - (y - prediction) ** 2))
    best = ("", 0.0)
    for box in single_inputs(names, j):
        made = left_out(rows.columns(box, j)[own], y, fold, RIDGES[1::2])
        part = float(np.max(np.sum(y[:, None] ** 2 - (y[:, None] - made) ** 2, axis=0))) / max(saved, 1e-300)
        best = max(best, (box.name, part), key=lambda x: x[1])
    whole = np.zeros(len(own))
    whole[own] = prediction
    f = _middle_frequency(np.where(own, rows.rest[:, j], 0.0), whole, rows.block, rows.inputs[0].period * rows.thin)
    return replace(found, frequency=f, follows=best if best[0] else None)


def _middle_frequency(rest: FloatArray, prediction: FloatArray, block: NDArray[np.intp], period: float) -> float | None:
    """Frequency below which half of the power is that a prediction takes from a residual, shape (N,) each [Hz].

    Args:
        block: number of each row. period: between rows [s].
    """
    total: dict[int, FloatArray] = {}
    length = int(np.median(np.bincount(block)[np.unique(block)]))
    for b in np.unique(block):
        own = np.flatnonzero(block == b)[:length]
        if len(own) < length or not prediction[own].any():
            continue
        window = np.hanning(length)
        before, after = (np.abs(np.fft.rfft(x[own] * window)) ** 2 for x in (rest, rest - prediction))
        total[0] = total.get(0, np.zeros(len(before))) + before - after
    if not total:
        return None
    gained = np.maximum(total[0], 0.0)
    if not gained.any():
        return None
    f = np.fft.rfftfreq(length, period)
    return float(np.interp(0.5, np.cumsum(gained) / gained.sum(), f))
