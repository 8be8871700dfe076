"""Knobs of an effect by variable projection: the knob is searched for, all that is linear follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product

import numpy as np

from sysid_ros.effects import Effect, Knob, Motion
from sysid_ros.identification.bag_sums import BagSums
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import fit
from sysid_ros.identification.rows import SmoothRecording
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_COARSE, _FINE = 6, 5
"""Values of a knob over its range, and then around the best of them."""
_MOST = 400
"""Values over the range at most; more cost minutes."""
_SWEEPS = 4
_REFINEMENTS = 8
_ROWS = 2000
"""Rows at which it is seen whether neighbouring values look alike."""

Setting = tuple[float, ...]


@dataclass(slots=True)
class _Block:
    """What a setting adds to the normal equations: its product with the others' columns, its own, and its score."""

    cross: FloatArray
    own: FloatArray
    score: FloatArray


@dataclass(slots=True)
class _Place:
    """Where an effect is searched: joints (none for the whole arm), and the sums of the settings that were tried."""

    joints: tuple[str, ...]
    blocks: dict[Setting, _Block] = field(default_factory=dict)


class KnobSearch:
    """The settings of least cost of one effect, a place each.

    Args:
        model: all else that is free. effect: to be placed. where: joints of each place, none for the whole arm. knobs: of it.
    """

    def __init__(
        self,
        model: TorqueModel,
        effect: type[Effect],
        where: Sequence[tuple[str, ...]],
        knobs: Sequence[Knob],
        recordings: Sequence[SmoothRecording],
        method: str,
    ) -> None:
        self._model, self._kind, self._knobs, self._recordings = model, effect, knobs, recordings
        self._places = [_Place(joints) for joints in where]
        self._bags = [recording.rows(model) for recording in recordings]
        self._axes = [self._first_values(u) for u in range(len(where))]
        self.tried = max(int(np.prod([len(axis) for axis in axes])) for axes in self._axes)
        middle = [tuple(float(axis[len(axis) // 2]) for axis in axes) for axes in self._axes]
        self._method = method
        self._weigh(middle)

    def effect(self, u: int, setting: Setting) -> Effect:
        """The effect at a place with a setting."""
        named = {knob.name: float(value) for knob, value in zip(self._knobs, setting, strict=True)}
        return self._kind.from_settings(self._model.robot, self._places[u].joints, named)

    def unit(self, joints: tuple[str, ...], knob: Knob) -> str:
        """Of a knob at a place: a slide moves in metres."""
        robot = self._model.robot
        slides = bool(joints) and bool(robot.is_prismatic[robot.joint_names.index(joints[0])])
        return knob.unit.replace("rad", "m") if slides else knob.unit

    def run(self) -> tuple[list[Setting], list[list[bool]]]:
        """The best setting of each place, and whether the data determine each of its knobs."""
        best = self._descend([list(product(*axes)) for axes in self._axes], None)
        self._weigh(best)
        widths = [[_width(axis, knob) for axis, knob in zip(axes, self._knobs, strict=True)] for axes in self._axes]
        determined: list[list[bool]] = []
        for refinement in range(_REFINEMENTS):
            around = [
                [_around(knob, x, w) for knob, x, w in zip(self._knobs, setting, width, strict=True)]
                for setting, width in zip(best, widths, strict=True)
            ]
            best = self._descend([list(product(*axes)) for axes in around], best)
            if refinement == 0:
                determined = [self._determined(u, best, around[u], ends=True) for u in range(len(best))]
            # finer, as long as the data distinguish neighbouring values
            if not any(any(self._determined(u, best, around[u], ends=False)) for u in range(len(best))):
                break
            widths = [[_halved(w, k) for w, k in zip(width, self._knobs, strict=True)] for width in widths]
        return best, determined

    def _first_values(self, u: int) -> list[FloatArray]:
        """The grid of each knob over its range, so fine that neighbouring values look alike."""
        return [
            np.geomspace(k.low, k.high, _COARSE) if k.logarithmic else self._even_values(u, i) for i, k in enumerate(self._knobs)
        ]

    def _even_values(self, u: int, i: int) -> FloatArray:
        bag = max(self._bags, key=lambda bag: len(bag.t))
        rows = slice(0, _ROWS)
        motion = Motion(self._model.robot, bag.t[rows], bag.q[rows], bag.v[rows], bag.a[rows], bag.tau[rows])
        middle = [float(np.sqrt(k.low * k.high) if k.logarithmic else 0.5 * (k.low + k.high)) for k in self._knobs]

        def columns(value: float) -> FloatArray:
            setting = tuple(value if k == i else x for k, x in enumerate(middle))
            values = self.effect(u, setting).columns_along(motion)
            return values.reshape(-1, values.shape[2])

        knob, count = self._knobs[i], _COARSE
        while True:
            values = np.linspace(knob.low, knob.high, count)
            pairs = [(columns(values[k]), columns(values[k + 1])) for k in (0, count // 2, count - 2)]
            if 2 * count > _MOST or min(_shared(*pair) for pair in pairs) >= TOL.alike:
                return values
            count *= 2

    def _weigh(self, settings: Sequence[Setting]) -> None:
        """Take the weights of the rows from a fit with some settings, and sum up all rows of the other columns with them."""
        for place in self._places:
            place.blocks.clear()
        effects = [self.effect(u, setting) for u, setting in enumerate(settings)]
        beside = [np.concatenate([self._columns(b, e) for e in effects], axis=2) for b in range(len(self._bags))]
        both = [replace(bag, Y=np.concatenate([bag.Y, more], axis=2)) for bag, more in zip(self._bags, beside, strict=True)]
        model = TorqueModel(self._model.robot, [*self._model.free, *effects])
        prior = Prior.of(model)
        self._weight = fit(both, prior.mean, prior.std, self._method).weight
        sums = BagSums.of(self._bags)
        prior = Prior.of(self._model)
        self._information = sums.information(self._weight) + np.diag(prior.precision())
        self._side = sums.right_side(self._weight) + prior.precision() * prior.mean
        slices = model.slices[len(self._model.free) :]
        at = [slice(s.start - self._model.p, s.stop - self._model.p) for s in slices]
        joints = [np.any([(x[:, :, s] != 0.0).any(axis=(0, 2)) for x in beside], axis=0) for s in at]
        self._in_turn = len(joints) > 1 and int(np.max(np.sum(joints, axis=0))) <= 1

    def _columns(self, b: int, effect: Effect) -> FloatArray:
        out = np.zeros((len(self._bags[b].t), self._model.robot.n, effect.p))
        self._recordings[b].fill(effect, out)
        return out

    def _block(self, u: int, setting: Setting) -> _Block:
        known = self._places[u].blocks
        if setting not in known:
            effect = self.effect(u, setting)
            own = Prior.of(TorqueModel(self._model.robot, [effect])).precision()
            block = _Block(np.zeros((self._model.p, effect.p)), np.diag(own), np.zeros(effect.p))
            for b, bag in enumerate(self._bags):
                columns = self._columns(b, effect)
                for j in np.flatnonzero(columns.any(axis=(0, 2))):
                    x = columns[:, j] * (self._weight[b, j] * bag.moving[:, j])[:, None]
                    block.cross += bag.Y[:, j].T @ x
                    block.own += columns[:, j].T @ x
                    block.score += x.T @ bag.y[:, j]
            known[setting] = block
        return known[setting]

    def _cost(self, settings: dict[int, Setting]) -> float:
        """Weighted sum of squares, but for a constant, with the effect at some places; its rows at two places share nothing."""
        blocks = [self._block(u, setting) for u, setting in settings.items()]
        cross = np.hstack([b.cross for b in blocks])
        p, ends = len(self._side), np.cumsum([0, *(len(b.score) for b in blocks)])
        A = np.block([[self._information, cross], [cross.T, np.zeros((int(ends[-1]),) * 2)]])
        for block, (start, end) in zip(blocks, pairwise(ends), strict=True):
            A[p + start : p + end, p + start : p + end] = block.own
        side = np.concatenate([self._side, *(b.score for b in blocks)])
        return -float(side @ np.linalg.solve(A, side))

    def _with(self, best: Sequence[Setting], u: int, setting: Setting) -> dict[int, Setting]:
        others = {k: x for k, x in enumerate(best) if k != u} if self._in_turn else {}
        return {**others, u: setting}

    def _descend(self, grids: Sequence[Sequence[Setting]], start: Sequence[Setting] | None) -> list[Setting]:
        best = list(start) if start is not None else [grid[len(grid) // 2] for grid in grids]
        for _ in range(_SWEEPS):
            before = list(best)
            for u, grid in enumerate(grids):
                best[u] = min(grid, key=lambda setting: self._cost(self._with(best, u, setting)))
            if before == best or not self._in_turn:
                break
        return best

    def _determined(self, u: int, best: Sequence[Setting], axes: Sequence[FloatArray], ends: bool) -> list[bool]:
        """Whether the ends of the grid around the best, or its neighbours, are significantly worse, a knob each."""
        least = self._cost(self._with(best, u, best[u]))
        out = []
        for i, axis in enumerate(axes):
            at = int(np.argmin(np.abs(axis - best[u][i])))
            beside = (0, len(axis) - 1) if ends else (max(at - 1, 0), min(at + 1, len(axis) - 1))
            others = [tuple(float(axis[k]) if m == i else x for m, x in enumerate(best[u])) for k in beside]
            out.append(min(self._cost(self._with(best, u, s)) for s in others) - least > TOL.evidence)
        return out


def _shared(first: FloatArray, second: FloatArray) -> float:
    """Part of some columns that others can follow, 0 to 1."""
    rest = second - first @ np.linalg.lstsq(first, second, rcond=None)[0]
    return 1.0 - float(np.sum(rest**2)) / max(float(np.sum(second**2)), 1e-300)


def _width(axis: FloatArray, knob: Knob) -> float:
    """Ratio, or difference, of neighbouring values of a grid."""
    return float(axis[1] / axis[0] if knob.logarithmic else axis[1] - axis[0])


def _halved(width: float, knob: Knob) -> float:
    return width**0.5 if knob.logarithmic else 0.5 * width


def _around(knob: Knob, x: float, width: float) -> FloatArray:
    """Finer values around one, as far as the knob's range goes."""
    if knob.logarithmic:
        values = np.geomspace(x / width, x * width, _FINE)
    else:
        values = np.linspace(x - width, x + width, _FINE)
    return np.clip(values, knob.low, knob.high)
