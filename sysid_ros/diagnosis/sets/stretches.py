"""Whitened rows of all columns that are asked, back in time and cut into stretches, and their normal equations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.fit import Problem
from sysid_ros.diagnosis.sets.never_known import unknown_columns
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

_STRETCH = 1.5
"""Length of a stretch [s]: longer than what whitening leaves of a correlation."""
_MOST = 60
"""More stretches tell no more, and cost time."""

Indices = NDArray[np.intp]
Rows = tuple[Problem, Callable[[Term], Term]]
"""Rows, and what a term is on them."""


class Stretches:
    """Rows and normal equations of all columns, stretch by stretch.

    Args:
        rows: those that are predicted: of the fitted recordings, then of held-out ones. terms: all that are asked.
        noise: what the rows are weighted by. dry: level of the dry friction on each joint, shape (n,) [N m].

    Attributes:
        slices: columns of each term. inexact: those of the inexact links. unknown: those of what is never known of a joint; they
            stand with the terms of that joint. count: of all columns, P.
        stretches: how many there are, S. size: rows of each joint that count in each, shape (S, n). fitted: which
            are of the fitted recordings, shape (S,).
        x, y: rows of a joint, shape (S, P_j, L), and of all targets, shape (S, n, L), zero beyond the end of a stretch.
        place: where each column stands in ``x`` of a joint, -1 for one that does not load it, shape (P,).
        held_out_x: ``x`` of the stretches that are not fitted; empty where there are none. predicting: the first of them: what
            all fitted rows tell of the parameters predicts each. length: of each stretch, shape (S,).
        G, b: information of each stretch, shape (S, P, P), and score, shape (S, P), of the fitted rows. whole, score: of all of
            them. all_over_fitted: number of rows over that of the fitted ones.
    """

    def __init__(self, rows: Sequence[Rows], terms: Sequence[Term], noise: RowNoise, dry: FloatArray) -> None:
        self._problems = [problem for problem, _ in rows]
        unknown = [unknown_columns(p, dry) for p in self._problems]
        self._root = [1.0 / np.sqrt(noise.along(p.band)) for p in self._problems]
        self._lay_out(terms, len(unknown[0]))
        columns: dict[int, list[FloatArray]] = {j: [] for j in self._index}
        targets = []
        for (problem, there), root, never in zip(rows, self._root, unknown, strict=True):
            target = np.zeros_like(problem.y)
            for j, index in self._index.items():
                if j not in problem.active:
                    columns[j].append(np.zeros((len(problem.y), len(index))))
                    continue
                own = [there(terms[i]) for i in self._local[j]]
                shared = [there(terms[i]).columns[:, j] for i in self._local[None]]
                X = np.concatenate([*(t.columns for t in own), never[:, :, j].T, *shared, problem.nuisance[:, j]], axis=1)
                columns[j].append(_in_time(problem, X * root[:, j, None]))
                target[:, j] = problem.y[:, j] * root[:, j]
            targets.append(_in_time(problem, target))
        self._cut()
        self.y = self._by_stretch(np.concatenate(targets))
        self.x = {j: self._by_stretch(np.concatenate(columns[j])) for j in self._index}
        self.place = {j: np.full(self.count, -1) for j in self.x}
        for j, index in self._index.items():
            self.place[j][index] = np.arange(len(index))
        self.held_out_x = {j: x[~self.fitted] for j, x in self.x.items()} if not self.fitted.all() else {}
        self._equations()

    def _lay_out(self, terms: Sequence[Term], each: int) -> None:
        """Which columns are whose: what loads one joint stands together, what loads several comes after all that."""
        moves = [int(j) for j in self._problems[0].active]
        self._local: dict[int | None, list[int]] = {
            row: [i for i, t in enumerate(terms) if t.row == row] for row in (*moves, None)
        }
        lost = [i for i, t in enumerate(terms) if t.row is not None and t.row not in moves]
        where: dict[int, slice] = {}
        own: dict[int, slice] = {}
        unknown, start = [], 0
        for row in moves:
            begin = start
            start = _placed(terms, self._local[row], where, start)
            unknown.append(np.arange(start, start + each))
            start += each
            own[row] = slice(begin, start)
        start = first = _placed(terms, lost, where, start)
        start = _placed(terms, self._local[None], where, start)
        self.inexact = np.arange(start, start + self._problems[0].nuisance.shape[2])
        self.count = start + len(self.inexact)
        self.slices = [where[i] for i in range(len(terms))]
        self.unknown: Indices = np.concatenate([np.zeros(0, dtype=np.intp), *unknown])
        self._own, self._shared = own, slice(first, self.count)
        self._index = {j: np.r_[x, self._shared] for j, x in own.items()}

    def _cut(self) -> None:
        """The stretches, as rows of each."""
        seconds = sum(p.band.seconds for p in self._problems)
        length, begin, edges, counted = max(_STRETCH, seconds / _MOST), 0, [0], list[FloatArray]()
        for problem in self._problems:
            for i, where, count in problem.band.slices:
                parts = max(1, round((where.stop - where.start) * problem.band.motions[i].period / length))
                edges += [begin + len(p) for p in _running(np.array_split(np.arange(count), parts))]
                counted += problem.band.counted_in(i, where, parts)
                begin += count
        self.stretches = len(edges) - 1
        self.length = np.diff(edges)
        self.size = np.maximum(self.length[:, None] * np.array(counted), 1.0)
        self.fitted = np.array(edges[:-1]) < len(self._root[0])
        self.predicting = int(self.fitted.argmin())
        self._filled = np.arange(int(self.length.max())) < self.length[:, None]

    def _by_stretch(self, rows: FloatArray) -> FloatArray:
        """Columns of each stretch, shape (S, c, L), zero beyond its end, of rows of shape (R, c)."""
        out = np.zeros((*self._filled.shape, rows.shape[1]))
        out[self._filled] = rows
        return np.ascontiguousarray(out.swapaxes(1, 2))

    def _equations(self) -> None:
        self.G = np.zeros((self.stretches, self.count, self.count))
        self.b = np.zeros((self.stretches, self.count))
        fitted, shared = self.fitted, self._shared
        for j, own in self._own.items():
            x, p = self.x[j] * fitted[:, None, None], own.stop - own.start
            alone, both = x[:, :p], x[:, p:].swapaxes(1, 2)
            self.G[:, own, own] = alone @ alone.swapaxes(1, 2)
            self.G[:, own, shared] = alone @ both
            self.G[:, shared, own] = self.G[:, own, shared].swapaxes(1, 2)
            self.G[:, shared, shared] += x[:, p:] @ both
            self.b[:, self._index[j]] += (x @ self.y[:, j, :, None])[:, :, 0]
        self.all_over_fitted = float(np.sum(self._filled)) / len(self._root[0])
        self.whole, self.score = self.G.sum(axis=0), self.b.sum(axis=0)

    def noise(self, left: FloatArray) -> RowNoise:
        """The noise that makes what is left of the fitted recordings, of whitened rows of shape (S, n, L), the most likely."""
        return self._problems[0].band.noise_of(self.rows(left)[0])

    def rows(self, left: FloatArray) -> list[FloatArray]:
        """Of whitened rows of each stretch, shape (S, n, L), those of each problem as they were, shape (K, n) each."""
        out, rows = [], left.swapaxes(1, 2)[self._filled]
        for problem, root in zip(self._problems, self._root, strict=True):
            out.append(_in_frequency(problem, rows[: len(root)]) / root)
            rows = rows[len(root) :]
        return out

    def without_each(self, rows: Indices, columns: Indices) -> FloatArray:
        """Information of some columns with others in all fitted rows but those of each stretch, shape (S, r, c)."""
        rest = self.G[:, rows[:, None], columns]
        np.subtract(self.whole[rows[:, None], columns], rest, out=rest)
        return rest


def _running(parts: Sequence[NDArray[np.int_]]) -> list[NDArray[np.int_]]:
    """Each part with all before it."""
    return [np.concatenate(list(parts[: i + 1])) for i in range(len(parts))]


def _placed(terms: Sequence[Term], which: Sequence[int], where: dict[int, slice], start: int) -> int:
    """Columns of some terms, from ``start`` on; the first that is free after them."""
    for i in which:
        where[i] = slice(start, start + terms[i].p)
        start += terms[i].p
    return start


def _in_time(problem: Problem, rows: FloatArray) -> FloatArray:
    return _each_segment(problem, rows, lambda x: fft.idct(x, axis=0, norm="ortho"))


def _in_frequency(problem: Problem, rows: FloatArray) -> FloatArray:
    return _each_segment(problem, rows, lambda x: fft.dct(x, axis=0, norm="ortho"))


def _each_segment(problem: Problem, rows: FloatArray, how: Callable[[FloatArray], FloatArray]) -> FloatArray:
    out, begin = np.empty_like(rows), 0
    for _, _, count in problem.band.slices:
        out[begin : begin + count] = how(rows[begin : begin + count])
        begin += count
    return out
