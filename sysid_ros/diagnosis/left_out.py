"""Left out: how well any set of terms predicts each stretch of the recordings without having seen it.

The whitened rows go back into time and are cut into stretches. A set's parameters without a stretch follow from normal equations
less those of the stretch, so what any set predicts costs no new pass over the rows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.covariance import unknown_columns
from sysid_ros.diagnosis.fit import Problem, inverse_of, scatter_ratios
from sysid_ros.diagnosis.term import Term
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
        theta: shape (S, a). left: whitened rows that are left of each joint, stretch by stretch, shape (S, L, n).
        likelihood: of each stretch, with its part of the log-prior of the parameters, shape (S,).
        information, score: of all fitted rows, shape (a, a) with the prior and (a,).
    """

    at: Indices
    prior: FloatArray
    covariance: FloatArray
    theta: FloatArray
    left: FloatArray
    likelihood: FloatArray
    information: FloatArray
    score: FloatArray

    @cached_property
    def with_all_rows(self) -> tuple[FloatArray, FloatArray]:
        """Covariance and parameters with no stretch left out."""
        covariance = inverse_of(self.information)
        return covariance, covariance @ self.score


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

    def __init__(self, rows: Sequence[Rows], terms: Sequence[Term], noise: RowNoise, dry: FloatArray) -> None:
        self._problems = [problem for problem, _ in rows]
        starts = np.cumsum([0, *(t.p for t in terms)])
        self.slices = [slice(int(a), int(a) + t.p) for a, t in zip(starts, terms, strict=False)]
        self.inexact = np.arange(starts[-1], starts[-1] + self._problems[0].nuisance.shape[2])
        unknown = [unknown_columns(p, dry) for p in self._problems]
        moves, each = [int(j) for j in self._problems[0].active], len(unknown[0])
        self.joints = len(moves)
        self.unknown = int(starts[-1]) + len(self.inexact) + np.arange(each * self.joints)
        self.count = int(starts[-1]) + len(self.inexact) + len(self.unknown)
        self._root = [1.0 / np.sqrt(noise.along(p.band)) for p in self._problems]
        n = self._problems[0].band.n
        columns: dict[int, list[FloatArray]] = {j: [] for j in range(n)}
        self._index: dict[int, Indices] = {}
        targets = []
        for (problem, there), root, never in zip(rows, self._root, unknown, strict=True):
            blocks, _ = problem.blocks([there(t) for t in terms], True)
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
        self._cut()
        self._y = self._by_stretch(np.concatenate(targets))
        self._x = {j: self._by_stretch(_stacked(columns[j], len(index))) for j, index in self._index.items()}
        self._place = {j: np.full(self.count, -1) for j in self._x}
        for j, index in self._index.items():
            self._place[j][index] = np.arange(len(index))
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
        self.stretches = len(edges) - 1
        self._size = np.diff(edges).astype(float)
        self._fitted = np.array(edges[:-1]) < len(self._root[0])
        self._filled = np.arange(int(self._size.max())) < self._size[:, None]

    def _by_stretch(self, rows: FloatArray) -> FloatArray:
        """Rows of each stretch, shape (S, L, ...), zero beyond its end."""
        out = np.zeros((*self._filled.shape, *rows.shape[1:]))
        out[self._filled] = rows
        return out

    def _equations(self) -> None:
        self._G = np.zeros((self.stretches, self.count, self.count))
        self._b = np.zeros((self.stretches, self.count))
        for j, x in self._x.items():
            index = self._index[j]
            self._G[:, index[:, None], index] += x.swapaxes(1, 2) @ x
            self._b[:, index] += np.einsum("sla,sl->sa", x, self._y[:, :, j])
        self._G[~self._fitted], self._b[~self._fitted] = 0.0, 0.0
        self._all_over_fitted = float(np.sum(self._size)) / len(self._root[0])
        self._whole, self._score = self._G.sum(axis=0), self._b.sum(axis=0)

    def of(self, at: Indices, prior: FloatArray) -> Predicted:
        """What columns predict, with the inverse variances of their parameters before any data, shape (a,)."""
        M = self._without(at, at)
        M[:, np.arange(len(at)), np.arange(len(at))] += prior
        covariance = inverse_of(M)
        theta = np.einsum("sab,sb->sa", covariance, self._score[at] - self._b[:, at])
        return self._predicted(at, prior, covariance, theta)

    def without(self, state: Predicted, where: Indices) -> Predicted:
        """What is predicted without some of a set's columns. Args: where: their places in ``state.at``."""
        rest = np.delete(np.arange(len(state.at)), where)
        K, cross = state.covariance, state.covariance[:, rest[:, None], where]
        own = K[:, where[:, None], where]
        own = own + np.maximum(1e-9 * np.diagonal(own, axis1=1, axis2=2), 1e-30)[:, :, None] * np.eye(len(where))
        given = np.linalg.solve(own, cross.swapaxes(1, 2))
        theta = state.theta[:, rest] - np.einsum("sca,sc->sa", given, state.theta[:, where])
        return self._predicted(state.at[rest], state.prior[rest], K[:, rest[:, None], rest] - cross @ given, theta)

    def _predicted(self, at: Indices, prior: FloatArray, covariance: FloatArray, theta: FloatArray) -> Predicted:
        left = self._y.copy()
        for j, x in self._x.items():
            place = self._place[j][at]
            left[:, :, j] -= (x[:, :, place[place >= 0]] @ theta[:, place >= 0, None])[:, :, 0]
        power = np.einsum("slj,slj->sj", left, left)[:, None]
        likelihood = self._likelihood(power, np.sum(theta**2 * prior, axis=1)[:, None])[:, 0]
        information = self._whole[np.ix_(at, at)] + np.diag(prior)
        return Predicted(at, prior, covariance, theta, left, likelihood, information, self._score[at])

    def plus(self, state: Predicted, each: Sequence[Indices], priors: Sequence[FloatArray]) -> FloatArray:
        """Likelihood of each stretch with more columns, one of several sets of them at a time, shape (m, S)."""
        out = np.empty((len(each), self.stretches))
        for width in {len(at) for at in each}:
            which = [i for i, at in enumerate(each) if len(at) == width]
            out[which] = self._plus(state, np.stack([each[i] for i in which]), np.stack([priors[i] for i in which]))
        return out

    def _plus(self, state: Predicted, at: Indices, prior: FloatArray) -> FloatArray:
        """As :meth:`plus`, for sets of equally many columns, shape (m, c) both."""
        m, c = at.shape
        a, S = len(state.at), self.stretches
        cross = self._without(state.at, at.reshape(-1))
        own = self._whole[at[:, :, None], at[:, None, :]] - self._G[:, at[:, :, None], at[:, None, :]]
        own[:, :, np.arange(c), np.arange(c)] += prior + 1e-9 * np.diagonal(self._whole)[at]
        taken = (state.covariance @ cross).reshape(S, a, m, c).transpose(0, 2, 1, 3)
        cross = cross.reshape(S, a, m, c).transpose(0, 2, 3, 1)
        rest = own - cross @ taken
        score = self._score[at] - self._b[:, at] - np.einsum("smca,sa->smc", cross, state.theta)
        least = np.maximum(1e-9 * np.diagonal(own, axis1=2, axis2=3), 1e-30)[..., None] * np.eye(c)
        step = np.linalg.solve(rest + least, score[..., None])[..., 0]
        change = -np.einsum("smac,smc->sam", taken, step)
        power = np.empty((S, m, self._y.shape[2]))
        for j in range(self._y.shape[2]):
            left = np.repeat(state.left[:, :, j, None], m, axis=2)
            if j in self._x:
                place = self._place[j][state.at]
                left -= self._x[j][:, :, place[place >= 0]] @ change[:, place >= 0]
                place = self._place[j][at]
                here = np.flatnonzero((place >= 0).any(axis=1))
                more = np.where(place[here] >= 0, step[:, here], 0.0)
                left[:, :, here] -= np.einsum("slmc,smc->slm", self._x[j][:, :, place[here]], more)
            power[:, :, j] = np.einsum("slm,slm->sm", left, left)
        known = np.sum((state.theta[:, :, None] + change) ** 2 * state.prior[:, None], axis=1)
        known += np.sum(step**2 * prior, axis=2)
        return self._likelihood(power, known).T

    def most(self, state: Predicted, gone: Indices, each: Sequence[Indices], priors: Sequence[FloatArray]) -> FloatArray:
        """What all rows gain at most, about, with one of several sets of columns in place of some of a state's, shape (m,).

        It follows from normal rows with no stretch left out: Student's gain no more than twice what those gain, and lose the
        least where one stretch of one joint loses it all. It is no strict bound, for held-out rows are taken to gain as many
        times more as there are more of them, and a stretch to be left out is not.

        Args:
            gone: places of the columns in ``state.at``. each: the other columns; a set may be empty.
        """
        covariance, theta = state.with_all_rows
        loss, rest = 0.0, np.delete(np.arange(len(state.at)), gone)
        if len(gone):
            cross = covariance[np.ix_(rest, gone)]
            given = np.linalg.lstsq(covariance[np.ix_(gone, gone)], np.column_stack([cross.T, theta[gone]]), rcond=1e-12)[0]
            loss = 0.5 * float(theta[gone] @ given[:, -1])
            covariance, theta = covariance[np.ix_(rest, rest)] - cross @ given[:, :-1], theta[rest] - cross @ given[:, -1]
        net = np.full(len(each), -loss)
        for i, (at, prior) in enumerate(zip(each, priors, strict=True)):
            cross, own = self._whole[np.ix_(state.at[rest], at)], self._whole[np.ix_(at, at)]
            score = self._score[at] - cross.T @ theta
            left = own + np.diag(prior + 1e-9 * np.diagonal(own) + 1e-30) - cross.T @ covariance @ cross
            net[i] += 0.5 * float(score @ np.linalg.lstsq(left, score, rcond=1e-12)[0])
        least = float(self._size.min())
        return np.where(net > 0.0, 2.0 * self._all_over_fitted * net, -least * np.log1p(np.maximum(-net, 0.0) / least))

    def _likelihood(self, power: FloatArray, known: FloatArray) -> FloatArray:
        """Of each stretch, shape (S, m), up to a constant. What is known of the parameters before any data counts once in all.

        The level of a joint's noise in one stretch is known as well as that many rows tell it (a scaled inverse chi-squared
        prior), so that the rows have Student's distribution: noise that comes and goes is not proof.

        Args:
            power: what is left of each stretch and joint, shape (S, m, n). known: twice the log-prior of the parameters with the
                other sign, shape (S, m).
        """
        size = self._size[:, None, None]
        return np.asarray(-np.sum(size * np.log1p(power / size), axis=2) - 0.5 * known / self.stretches)

    def scatter(self, state: Predicted) -> FloatArray:
        """By how much more the parameters of a set scatter from stretch to stretch than its noise explains, variance over
        variance, at least 1, shape (a,)."""
        each = self._G[self._fitted][:, state.at[:, None], state.at]
        scores = self._b[self._fitted][:, state.at] - each @ state.with_all_rows[1]
        return scatter_ratios(scores, each, state.information)

    def noise(self, left: FloatArray) -> RowNoise:
        """The noise that makes what is left of the fitted recordings, of whitened rows of shape (S, L, n), the most likely."""
        return self._problems[0].band.noise_of(self.rows(left)[0])

    def rows(self, left: FloatArray) -> list[FloatArray]:
        """Of whitened rows of each stretch, shape (S, L, n), those of each problem as they were, shape (K, n) each."""
        out, rows = [], left[self._filled]
        for problem, root in zip(self._problems, self._root, strict=True):
            out.append(_in_frequency(problem, rows[: len(root)]) / root)
            rows = rows[len(root) :]
        return out

    def _without(self, rows: Indices, columns: Indices) -> FloatArray:
        rest: FloatArray = self._whole[rows[:, None], columns] - self._G[:, rows[:, None], columns]
        return rest


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
