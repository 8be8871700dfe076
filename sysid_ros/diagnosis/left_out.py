"""Left out: how well any set of terms predicts each stretch of the recordings without having seen it.

The whitened rows go back into time and are cut into stretches. A set's parameters without a stretch follow from normal equations
less those of the stretch, so what any set predicts costs no new pass over the rows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from sysid_ros.diagnosis import never_known
from sysid_ros.diagnosis.fit import Problem
from sysid_ros.diagnosis.term import Term
from sysid_ros.diagnosis.torque_noise import Noise
from sysid_ros.sample import FloatArray

_STRETCH = 1.5
"""Length of a stretch [s]: longer than what whitening leaves of a correlation."""
_MOST = 60
"""More stretches tell no more, and cost time."""

Indices = NDArray[np.intp]
Rows = tuple[Problem, Callable[[Term], Term]]
"""Rows, and what a term is on them."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """What a set of columns predicts.

    Attributes:
        at: indices of the columns, shape (a,). prior: inverse variances of their parameters before any data, shape (a,).
        covariance: of the parameters without each stretch, shape (S, a, a).
        theta: shape (S, a). left: whitened rows that are left of each joint, shape (R, n).
        likelihood: of each stretch, with its part of the log-prior of the parameters, shape (S,).
    """

    at: Indices
    prior: FloatArray
    covariance: FloatArray
    theta: FloatArray
    left: FloatArray
    likelihood: FloatArray


class LeftOut:
    """Normal equations of all columns that are asked, stretch by stretch.

    Args:
        rows: those that are predicted: of the fitted recordings, each stretch from the others, then of held-out ones, from all
            that are fitted. terms: all that are asked.
        noise: what the rows are weighted by. dry: level of the dry friction on each joint, shape (n,) [N m].

    Attributes:
        slices: columns of each term; those of the inexact links and of what is never known come after all.
        joints: number of joints that have the latter. stretches: how many there are, S.
    """

    def __init__(self, rows: Sequence[Rows], terms: Sequence[Term], noise: Noise, dry: FloatArray) -> None:
        self._problems = [problem for problem, _ in rows]
        starts = np.cumsum([0, *(t.p for t in terms)])
        self.slices = [slice(int(a), int(a) + t.p) for a, t in zip(starts, terms, strict=False)]
        self.inexact = np.arange(starts[-1], starts[-1] + self._problems[0].nuisance.shape[2])
        unknown = [never_known.columns(p, dry) for p in self._problems]
        moves, each = [int(j) for j in self._problems[0].active], len(unknown[0])
        self.joints = len(moves)
        self.unknown = int(starts[-1]) + len(self.inexact) + np.arange(each * self.joints)
        self.count = int(starts[-1]) + len(self.inexact) + len(self.unknown)
        self._root = [1.0 / np.sqrt(noise.variance(p.band.f)) for p in self._problems]
        n = self._problems[0].band.n
        columns: dict[int, list[FloatArray]] = {j: [] for j in range(n)}
        self._index: dict[int, Indices] = {}
        targets = []
        for (problem, as_there), root, never in zip(rows, self._root, unknown, strict=True):
            blocks, _ = problem.blocks([as_there(t) for t in terms], True)
            target = np.zeros_like(problem.y)
            for j in range(n):
                index, X = blocks.get(j, (None, None))
                if index is None or X is None or j not in moves:
                    columns[j].append(np.zeros((len(problem.y), 0)))
                    continue
                own = each * moves.index(j)
                index = np.concatenate([index, self.unknown[own : own + each]])
                X = np.column_stack([X, never[:, :, j].T])
                self._index[j] = index
                columns[j].append(_in_time(problem, X * root[:, j, None]))
                target[:, j] = problem.y[:, j] * root[:, j]
            targets.append(_in_time(problem, target))
        self._y = np.concatenate(targets)
        self._x = {j: _stacked(columns[j], len(index)) for j, index in self._index.items()}
        self._cut()
        self._equations()

    def _cut(self) -> None:
        """The stretches, as rows of each."""
        seconds = sum(p.band.seconds for p in self._problems)
        length, begin, edges = max(_STRETCH, seconds / _MOST), 0, [0]
        for problem in self._problems:
            for i, where, count in problem.band.slices:
                parts = max(1, round((where.stop - where.start) * problem.band.motions[i].period / length))
                edges += [begin + len(p) for p in _running(np.array_split(np.arange(count), parts))]
                begin += count
        self._edges = np.array(edges)
        self.stretches = len(edges) - 1
        self._stretch = np.repeat(np.arange(self.stretches), np.diff(self._edges))
        self._size = np.diff(self._edges).astype(float)

    def _equations(self) -> None:
        self._G = np.zeros((self.stretches, self.count, self.count))
        self._b = np.zeros((self.stretches, self.count))
        for j, x in self._x.items():
            index = self._index[j]
            for s in range(self.stretches):
                rows = slice(self._edges[s], self._edges[s + 1])
                self._G[s][np.ix_(index, index)] += x[rows].T @ x[rows]
                self._b[s, index] += x[rows].T @ self._y[rows, j]
        fitted = self._edges[:-1] < len(self._root[0])
        self._G[~fitted], self._b[~fitted] = 0.0, 0.0
        self._whole, self._score = self._G.sum(axis=0), self._b.sum(axis=0)
        self._place = {j: np.full(self.count, -1) for j in self._x}
        for j, index in self._index.items():
            self._place[j][index] = np.arange(len(index))

    def of(self, at: Indices, prior: FloatArray) -> Predicted:
        """What columns predict, with the inverse variances of their parameters before any data, shape (a,)."""
        M = self._without(at, at)
        M[:, np.arange(len(at)), np.arange(len(at))] += prior
        covariance = _inverse(M)
        theta = np.einsum("sab,sb->sa", covariance, self._score[at] - self._b[:, at])
        left = self._y - self._torque(at, theta)
        return Predicted(at, prior, covariance, theta, left, self._likelihood(left, theta, prior))

    def without(self, state: Predicted, where: Indices) -> Predicted:
        """What is predicted without some of a set's columns. Args: where: their places in ``state.at``."""
        rest = np.delete(np.arange(len(state.at)), where)
        K, cross = state.covariance, state.covariance[:, rest[:, None], where]
        own = K[:, where[:, None], where]
        own = own + np.maximum(1e-9 * np.diagonal(own, axis1=1, axis2=2), 1e-30)[:, :, None] * np.eye(len(where))
        given = np.linalg.solve(own, cross.swapaxes(1, 2))
        theta = state.theta[:, rest] - np.einsum("sca,sc->sa", given, state.theta[:, where])
        left = self._y - self._torque(state.at[rest], theta)
        prior = state.prior[rest]
        covariance = K[:, rest[:, None], rest] - cross @ given
        return Predicted(state.at[rest], prior, covariance, theta, left, self._likelihood(left, theta, prior))

    def plus(self, state: Predicted, at: Indices, prior: FloatArray) -> FloatArray:
        """Likelihood of each stretch with more columns, shape (S,)."""
        cross, own = self._without(state.at, at), self._without(at, at)
        own[:, np.arange(len(at)), np.arange(len(at))] += prior + 1e-9 * np.diagonal(self._whole)[at]
        taken = state.covariance @ cross
        rest = own - cross.swapaxes(1, 2) @ taken
        score = self._score[at] - self._b[:, at] - np.einsum("sac,sa->sc", cross, state.theta)
        least = np.maximum(1e-9 * np.diagonal(own, axis1=1, axis2=2), 1e-30)[:, :, None] * np.eye(len(at))
        step = np.linalg.solve(rest + least, score[:, :, None])[:, :, 0]
        change = -np.einsum("sac,sc->sa", taken, step)
        left = state.left - self._torque(state.at, change) - self._torque(at, step)
        theta = np.concatenate([state.theta + change, step], axis=1)
        return self._likelihood(left, theta, np.concatenate([state.prior, prior]))

    def _likelihood(self, left: FloatArray, theta: FloatArray, prior: FloatArray) -> FloatArray:
        """Of each stretch, shape (S,), up to a constant. What is known of the parameters before any data counts once in all.

        The level of a joint's noise in one stretch is known as well as that many rows tell it (a scaled inverse chi-squared
        prior), so that the rows have Student's distribution: noise that comes and goes is not proof.
        """
        power = np.add.reduceat(left**2, self._edges[:-1], axis=0)
        rows = -np.sum(self._size[:, None] * np.log1p(power / self._size[:, None]), axis=1)
        return np.asarray(rows - 0.5 * (theta**2 @ prior) / self.stretches)

    def noise(self, left: FloatArray) -> Noise:
        """The noise that makes what is left of the fitted recordings, of whitened rows of shape (R, n), the most likely."""
        problem, root = self._problems[0], self._root[0]
        rows = _in_frequency(problem, left[: len(root)]) / root
        return Noise.of(problem.band.f, rows**2)

    def _without(self, rows: Indices, columns: Indices) -> FloatArray:
        rest: FloatArray = self._whole[rows[:, None], columns] - self._G[:, rows[:, None], columns]
        return rest

    def _torque(self, at: Indices, theta: FloatArray) -> FloatArray:
        """Whitened rows of parameters that differ from stretch to stretch, shape (R, n)."""
        out = np.zeros_like(self._y)
        for j, x in self._x.items():
            place = self._place[j][at]
            used = place >= 0
            if used.any():
                out[:, j] = np.einsum("ra,ra->r", x[:, place[used]], theta[self._stretch][:, used])
        return out


def _running(parts: Sequence[NDArray[np.int_]]) -> list[NDArray[np.int_]]:
    """Each part with all before it."""
    return [np.concatenate(list(parts[: i + 1])) for i in range(len(parts))]


def _stacked(parts: Sequence[FloatArray], width: int) -> FloatArray:
    """Rows of several recordings; where a joint does not move its columns are zero."""
    return np.concatenate([p if p.shape[1] else np.zeros((len(p), width)) for p in parts])


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


def _inverse(matrices: FloatArray) -> FloatArray:
    """Of symmetric matrices, shape (S, a, a), scaled first; directions that no row shows stay where they are."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrices, axis1=1, axis2=2), 1e-30))
    scaled = matrices * scale[:, :, None] * scale[:, None, :]
    scaled[:, np.arange(scaled.shape[1]), np.arange(scaled.shape[1])] += 1e-9
    inverse: FloatArray = np.linalg.inv(scaled) * scale[:, :, None] * scale[:, None, :]
    return inverse
