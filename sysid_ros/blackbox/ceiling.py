"""The ceiling: how much of the torque that a physical model leaves could any model explain, on which joint, where and with what.

For each joint five black boxes, and their sum with sizes of the largest likelihood (:mod:`.joint_parts`), predict the residual
of stretches that they were not fitted to. Which ridge counts for a stretch, and how much each of them counts for their mean, is
decided by the other stretches alone, so that having had a choice gains nothing. The gain is a sum over blocks of time; its
standard error is that of the blocks. It is claimed where few claims are chance, by the stronger of two tests of the blocks:
Student's t with Hall's correction for their skewness, as few blocks may hold most of a gain, and Wilcoxon's signed ranks. The
interval is Hall's too. That something is missing is so claimed from what was predicted; how large it is, of which a prediction is
a lower bound, is what is left less what is noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sysid_ros.blackbox.ceiling_result import Ceiling, JointCeiling
from sysid_ros.blackbox.ceiling_rows import FOLDS, CeilingRows
from sysid_ros.blackbox.joint_parts import JointParts
from sysid_ros.blackbox.left_out_ridge import RIDGES, left_out
from sysid_ros.blackbox.rest_boxes import BOXES
from sysid_ros.blackbox.rest_inputs import RestInputs, cutoff_of
from sysid_ros.blackbox.skewed_mean import SkewedMean
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion

_FEWEST_BLOCKS = 6
"""Blocks below which no standard error is worth its name."""
_LEVEL = 0.05


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
    both = [[i.seen(x) for x, i in zip(xs, inputs, strict=True)] for xs in (rest, [m.tau for m in motions])]
    rows = CeilingRows.of(inputs, both[0], both[1])
    judged = range(len(names)) if only is None else only
    asked = [_asked(rows, j, name) if j in judged else _unknown(rows, j, name) for j, name in enumerate(names)]
    claimed = _no_chance([x.found for x in asked])
    joints = [_described(_sized(x), x, rows, tuple(names), j) if j in claimed else x.found for j, x in enumerate(asked)]
    # where a joint stands dry friction holds it, and no torque is due
    torque, left = (float(np.sqrt(np.mean(np.sum(np.where(rows.moving, x, 0.0) ** 2, axis=1)))) for x in (rows.tau, rows.rest))
    less = sum(_power_missing(j) * rows.moves(k) for k, j in enumerate(joints) if j.claimed)
    after = float(np.sqrt(max(left**2 - less, 0.0)))
    return Ceiling(tuple(joints), left / max(torque, 1e-12), (left - after) / max(torque, 1e-12), len(BOXES) + 1)


@dataclass(frozen=True, eq=False)
class _Asked:
    """What black boxes say of one joint.

    Attributes:
        found: without what is told of joints where something is claimed. parts: of what is left; None for a joint that is not
            judged. prediction: of left-out rows in which the joint moves.
    """

    found: JointCeiling
    parts: JointParts | None
    prediction: FloatArray


def _unknown(rows: CeilingRows, joint: int, name: str) -> _Asked:
    torque = float(np.sqrt(np.mean(rows.tau[:, joint] ** 2)))
    return _Asked(JointCeiling(name, None, None, None, None, False, {}, 0, torque), None, np.zeros(0))


def _asked(rows: CeilingRows, j: int, joint: str) -> _Asked:
    own = rows.moving[:, j]
    block = rows.block[own]
    number = np.unique(block, return_inverse=True)[1]
    count = int(number.max(initial=-1)) + 1
    if count < _FEWEST_BLOCKS or len(np.unique(rows.fold[own])) < FOLDS:
        return _unknown(rows, j, joint)
    y, fold = rows.rest[own, j], rows.fold[own]
    torque = max(float(np.sqrt(np.mean(rows.tau[own, j] ** 2))), 1e-12)
    blocks = {box.name: rows.blocks(box, j) for box in BOXES}
    made = {name: left_out(np.column_stack(list(x.values()))[own], y, fold) for name, x in blocks.items()}
    parts = rows.parts(j, {name: x for part in blocks.values() for name, x in part.items()})
    each = [parts.left_out(rows.fold)[own][:, None], *made.values()]
    prediction = _together([_by_block(y, x, number, count) for x in each], each, number, fold)
    before = float(np.sqrt(np.mean(y**2)))
    gain, std, interval, p = _measured(_by_block(y, prediction[:, None], number, count)[:, 0], len(y), before)
    saved = np.sum(y[:, None] ** 2 - (y[:, None] - np.column_stack(list(made.values()))) ** 2, axis=0)
    best = int(np.argmax(saved))
    best_of = {name: float(part.max()) for name, part in zip(made, np.split(saved, len(made)), strict=True)}
    found = JointCeiling(
        joint,
        before / torque,
        gain / torque,
        std / torque,
        p,
        False,
        {name: _points(saved, len(y), before) / torque for name, saved in best_of.items()},
        count,
        torque,
        interval=interval and (interval[0] / torque, interval[1] / torque),
        chosen=(BOXES[best // len(RIDGES)].name, float(RIDGES[best % len(RIDGES)])) if saved[best] > 0.0 else None,
    )
    return _Asked(found, parts, prediction)


def _no_chance(found: Sequence[JointCeiling]) -> set[int]:
    """Joints of whose gains 5 % are chance, and where all are, with less than 5 % for one claim (Benjamini, Hochberg 1995)."""
    judged = sorted((j.p_value if j.p_value is not None else 1.0, k) for k, j in enumerate(found) if j.left is not None)
    few = [rank for rank, (p, _) in enumerate(judged, 1) if p < _LEVEL * rank / len(judged)]
    return {k for _, k in judged[: max(few, default=0)] if (found[k].gain or 0.0) > 0.0}


def _sized(asked: _Asked) -> JointCeiling:
    """A claim with the size of what is missing."""
    found = asked.found
    assert found.left is not None
    assert asked.parts is not None
    noise, (low, high) = asked.parts.noise()
    missing, least, most = (max(found.left - x / found.torque, 0.0) for x in (noise, high, low))
    return replace(found, claimed=True, missing=missing, missing_interval=(least, most))


def _by_block(y: FloatArray, predictions: FloatArray, number: NDArray[np.intp], count: int) -> FloatArray:
    """Squared error that each prediction saves in each block, shape (count, predictions)."""
    saved = y[:, None] ** 2 - (y[:, None] - predictions) ** 2
    out = np.zeros((count, predictions.shape[1]))
    np.add.at(out, number, saved)
    return out


def _together(
    gains: Sequence[FloatArray], predictions: Sequence[FloatArray], number: NDArray[np.intp], fold: NDArray[np.intp]
) -> FloatArray:
    """One prediction from those of several boxes with several ridges, shape (N,): of each fold the mean over the boxes, each with
    the ridge that saves most in the other folds, and with what it saves there as its weight; nothing where no box saves anything.

    Args:
        gains: of each box, by block, shape (count, ridges). predictions: shape (N, ridges). number: block of each row.
    """
    out = np.zeros(len(fold))
    for f in np.unique(fold):
        rows = fold == f
        others = np.unique(number[~rows])
        saved = [x[others].sum(axis=0) for x in gains]
        weights = [max(float(x.max()), 0.0) for x in saved]
        for x, weight, total in zip(predictions, weights, saved, strict=True):
            if weight > 0.0:
                out[rows] += weight / sum(weights) * x[rows, int(np.argmax(total))]
    return out


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


def _power_missing(j: JointCeiling) -> float:
    """Mean square that is missing while the joint moves [(N m)^2]."""
    assert j.left is not None
    assert j.missing is not None
    return float((j.left**2 - (j.left - j.missing) ** 2) * j.torque**2)


def _described(found: JointCeiling, asked: _Asked, rows: CeilingRows, names: tuple[str, ...], j: int) -> JointCeiling:
    """The same with its frequency and with what it follows."""
    own, prediction = rows.moving[:, j], asked.prediction
    y, fold = rows.rest[own, j], rows.fold[own]
    saved = float(np.sum(y**2 - (y - prediction) ** 2))
    best = ("", 0.0)
    for name, X in rows.alone(names, j):
        made = left_out(X[own], y, fold, RIDGES[1::2])
        part = float(np.max(np.sum(y[:, None] ** 2 - (y[:, None] - made) ** 2, axis=0))) / max(saved, 1e-300)
        best = max(best, (name, part), key=lambda x: x[1])
    whole = np.zeros(len(own))
    whole[own] = prediction
    f = _middle_frequency(np.where(own, rows.rest[:, j], 0.0), whole, rows.block, rows.inputs[0].period)
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
