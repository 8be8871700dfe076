"""The ceiling: how much of the torque that a physical model leaves could any model explain, on which joint, where and with what.

For each joint five black boxes predict the residual of stretches that they were not fitted to. Which box and which ridge counts
for a stretch is decided by the other stretches alone, among them a box that predicts nothing, so that having had a choice gains
nothing. The gain is a sum over blocks of time; its standard error is that of the blocks, and it is claimed where Student's t
leaves less than 5 % to chance for all joints together (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sysid_ros.blackbox.left_out_ridge import RIDGES, left_out
from sysid_ros.blackbox.rest_boxes import BOXES, Box, single_inputs
from sysid_ros.blackbox.rest_inputs import RestInputs, Spread, cutoff_of
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


@dataclass(frozen=True, eq=False)
class JointCeiling:
    """What black boxes predict of the torque that is left on one joint, as parts of the rms of its torque while it moves.

    Attributes:
        joint: name. left: rms of what the physical model leaves.
        gain: by how much the best black box makes it smaller on left-out data. gain_std: its standard error from blocks.
        p_value: that chance makes so much, one joint alone. claimed: whether it is no chance, all joints considered.
        boxes: the same gain of each black box with the ridge that is best for it in hindsight, by name. blocks: their number.
        torque: rms [N m]. frequency: in the middle of the power that is gained [Hz]. follows: channel that gains most alone, and
            its part of the gain. Both only where something is claimed, else None.
        chosen: name and ridge of the black box that is best in all; None where that is nothing.
    """

    joint: str
    left: float | None
    gain: float | None
    gain_std: float | None
    p_value: float | None
    claimed: bool
    boxes: dict[str, float]
    blocks: int
    torque: float
    frequency: float | None = None
    follows: tuple[str, float] | None = None
    chosen: tuple[str, float] | None = None


@dataclass(frozen=True, eq=False)
class Ceiling:
    """What is left of the torque, and what any of the black boxes predicts of it on data that it was not fitted to.

    Attributes:
        joints: each. left, gain: of all joints together: rms over the rms of all torques [N m], and how much of it is predicted
            where it is claimed. tried: number of black boxes.
    """

    joints: tuple[JointCeiling, ...]
    left: float
    gain: float
    tried: int

    @property
    def claimed(self) -> tuple[JointCeiling, ...]:
        """Joints on which something is missing, the largest part of their torque first."""
        return tuple(sorted((j for j in self.joints if j.claimed), key=lambda j: -(j.gain or 0.0)))

    @property
    def sentence(self) -> str:
        """For an engineer."""
        from sysid_ros.blackbox.ceiling_words import in_words

        return in_words(self)

    def as_dict(self) -> dict[str, Any]:
        """For machines: ``share`` is the part of each joint's torque that is missing in the model, 0 where none is claimed."""
        return {
            "joints": [j.joint for j in self.joints],
            "share": [(j.gain or 0.0) if j.claimed else 0.0 for j in self.joints],
            "left": [j.left for j in self.joints],
            "gain": [j.gain for j in self.joints],
            "gain_std": [j.gain_std for j in self.joints],
            "p_value": [j.p_value for j in self.joints],
            "frequency_hz": [j.frequency for j in self.joints],
            "follows": [j.follows and {"what": j.follows[0], "part": j.follows[1]} for j in self.joints],
            "black_box": [j.chosen[0] if j.chosen else None for j in self.joints],
            "black_boxes": {b.name: [j.boxes.get(b.name) for j in self.joints] for b in BOXES},
            "left_of_all": self.left,
            "gain_of_all": self.gain,
            "sentence": self.sentence,
        }


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
    gain, std, p = _measured(gained, len(y), before)
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


def _measured(gained: FloatArray, rows: int, before: float) -> tuple[float, float, float | None]:
    """Fall of the rms, its standard error, and the probability that chance makes so much."""
    count, total = len(gained), float(gained.sum())
    gain = _points(total, rows, before)
    error = float(np.sqrt(count) * np.std(gained, ddof=1))
    after = max(before - gain, 0.5 * before)
    std = error / rows / (before + after)
    p = float(stats.t.sf(total / error, count - 1)) if error > 0.0 else None
    return gain, std, p


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
    from dataclasses import replace

    from sysid_ros.blackbox.ceiling_words import middle_frequency

    y = rows.rest[own, j]
    saved = float(np.sum(y**2 - (y - prediction) ** 2))
    best = ("", 0.0)
    for box in single_inputs(names, j):
        made = left_out(rows.columns(box, j)[own], y, fold, RIDGES[1::2])
        part = float(np.max(np.sum(y[:, None] ** 2 - (y[:, None] - made) ** 2, axis=0))) / max(saved, 1e-300)
        best = max(best, (box.name, part), key=lambda x: x[1])
    whole = np.zeros(len(own))
    whole[own] = prediction
    f = middle_frequency(np.where(own, rows.rest[:, j], 0.0), whole, rows.block, rows.inputs[0].period * rows.thin)
    return replace(found, frequency=f, follows=best if best[0] else None)
