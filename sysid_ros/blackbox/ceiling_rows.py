"""What the ceiling judges: rows of all stretches, in blocks and folds, with what black boxes see of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sysid_ros.blackbox.joint_parts import JointParts, JointRest, turns_of
from sysid_ros.blackbox.rest_boxes import Box, single_inputs
from sysid_ros.blackbox.rest_features import Blocks, harmonics
from sysid_ros.blackbox.rest_inputs import RestInputs, Spread
from sysid_ros.robot.smoothed_sign import SLIDE
from sysid_ros.sample import FloatArray

_BLOCK = 1.5
"""Length of a block [s]: longer than slow noise is remembered by most joints."""
FOLDS = 5
_MOST_ROWS = 6000
"""Rows beyond which more tell nothing new, and cost time."""


@dataclass(frozen=True, eq=False)
class CeilingRows:
    """All stretches in a row, or as many blocks of them, evenly, as have no more rows than count.

    Attributes:
        inputs: stretches. spread: of their channels. kept: rows of them that are used. t: [s]. stretch: of each row. rest, tau:
            shape (N, n). moving: shape (N, n). stands: number of the standstill, 0 for none. block, fold: of each row.
        known: columns of boxes that see one channel alone.
    """

    inputs: tuple[RestInputs, ...]
    spread: Spread
    kept: NDArray[np.bool_]
    t: FloatArray
    stretch: NDArray[np.intp]
    rest: FloatArray
    tau: FloatArray
    moving: NDArray[np.bool_]
    stands: NDArray[np.intp]
    block: NDArray[np.intp]
    fold: NDArray[np.intp]
    known: dict[str, FloatArray] = field(default_factory=dict)

    @classmethod
    def of(cls, inputs: Sequence[RestInputs], rest: Sequence[FloatArray], tau: Sequence[FloatArray]) -> CeilingRows:
        """Blocks never reach over the end of a stretch; a fold is blocks that follow each other."""
        numbers, stands, start, still = [], [], 0, 0
        for i in inputs:
            count = max(1, round(len(i.t) * i.period / _BLOCK))
            numbers.append(start + np.minimum(np.arange(len(i.t)) * count // max(len(i.t), 1), count - 1))
            stands.append(np.where(i.stands > 0, i.stands + still, 0))
            start, still = start + count, still + int(i.stands.max(initial=0))
        block, length = np.concatenate(numbers), sum(len(i.t) for i in inputs)
        chosen = np.linspace(0, start - 1, min(start, max(1, start * _MOST_ROWS // max(length, 1)))).round()
        kept = np.isin(block, chosen)
        stretch = np.concatenate([np.full(len(i.t), k) for k, i in enumerate(inputs)])
        return cls(
            tuple(inputs),
            Spread.of(inputs),
            kept,
            np.concatenate([i.t for i in inputs])[kept],
            stretch[kept],
            np.concatenate(rest)[kept],
            np.concatenate(tau)[kept],
            np.concatenate([i.moving for i in inputs])[kept],
            np.concatenate(stands)[kept],
            block[kept],
            (block * FOLDS // max(start, 1))[kept],
        )

    def alone(self, names: tuple[str, ...], joint: int) -> list[tuple[str, FloatArray]]:
        """Names and columns of boxes that see one channel alone, shape (N, c); computed once for all joints."""
        boxes = single_inputs(names, joint)
        for box in boxes:
            if box.name not in self.known:
                self.known[box.name] = np.column_stack(list(self.blocks(box, joint).values()))
        return [(box.name, self.known[box.name]) for box in boxes]

    def blocks(self, box: Box, joint: int) -> Blocks:
        """Functions of a box by kind, shape (N, c) each."""
        each = [box.blocks(i, self.spread, joint) for i in self.inputs]
        return {name: np.concatenate([x[name] for x in each])[self.kept] for name in each[0]}

    def harmonics(self, joint: int, k: FloatArray) -> FloatArray:
        """Sines and cosines of k times a joint's position, shape (N, 2 len(k))."""
        return np.concatenate([harmonics(i, joint, k) for i in self.inputs])[self.kept]

    def parts(self, j: int, functions: Blocks) -> JointParts:
        """Of what is left of a joint's torque."""
        first = self.inputs[0]
        q, unit = np.concatenate([i.q[:, j] for i in self.inputs]), SLIDE if first.robot.is_prismatic[j] else 1.0
        rest = JointRest(
            self.rest[:, j],
            self.t,
            self.stretch,
            self.moving[:, j],
            self.stands,
            self.block,
            functions,
            lambda k: self.harmonics(j, k),
            turns_of(q, unit),
            first.cutoff,
            first.white,
        )
        return JointParts(rest)

    def moves(self, joint: int) -> float:
        """Part of the rows in which a joint moves."""
        return float(np.mean(self.moving[:, joint]))
