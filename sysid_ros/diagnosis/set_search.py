"""The search over sets of causes: which set is the most probable, and how probable each of its causes is."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np

from sysid_ros.diagnosis import never_known
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.left_out import Indices, LeftOut, Predicted, Rows
from sysid_ros.diagnosis.set_prior import SetPrior
from sysid_ros.diagnosis.term import Term
from sysid_ros.diagnosis.torque_noise import Noise
from sysid_ros.effects import EFFECTS, Effect, forms_of
from sysid_ros.sample import FloatArray

INEXACT = (0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 5.0)
"""How inexact all links of a URDF may be, in units of the usual inexactness."""
_MOVES = 200
_TRIED = 6
"""Moves of one kind that are tried in full, the best first."""
_LEAST = 0.05
"""Log-probability by which a move must be better."""
_DRAWS = 400

Seen = Callable[[Fit, Term], bool]


@dataclass(frozen=True, eq=False)
class State:
    """A set of terms (indices of the pool), the inexactness of the links, what they predict, and the log-probability.

    Attributes:
        narrowed: what it costs that so inexact links could have had other torques, and the rows left them little of that.
    """

    members: tuple[int, ...]
    scale: int
    predicted: Predicted
    narrowed: float
    score: float


@dataclass(frozen=True, eq=False)
class Posterior:
    """Of the terms of the most probable set: probability, the part of the rest that nothing in their place has, and what the
    effects have that stand in for them."""

    probability: dict[Term, float] = field(default_factory=dict)
    nothing: dict[Term, float] = field(default_factory=dict)
    instead: dict[Term, dict[str, float]] = field(default_factory=dict)


class SetSearch:
    """Sets of terms from a pool, judged by what they predict of stretches that were left out and by how usual they are.

    Args:
        problem: the fitted rows. rows: the rows that are predicted, the fitted ones among them. pool: all terms.
        noise, dry: as :class:`LeftOut` has them.
        allowed: False for a term of a fit that physics does not allow or that nobody can see.
    """

    def __init__(
        self,
        problem: Problem,
        rows: Sequence[Rows],
        pool: Sequence[Term],
        prior: SetPrior,
        noise: Noise,
        dry: FloatArray,
        allowed: Seen,
    ) -> None:
        self.problem, self.pool, self.prior, self._allowed = problem, list(pool), prior, allowed
        self.noise = noise
        self._rows = rows
        self.left_out = LeftOut(rows, pool, noise, dry)
        self._at = [np.arange(s.start, s.stop) for s in self.left_out.slices]
        self._prior = [t.prior for t in pool]
        self._against = [{k for k, other in enumerate(pool) if k != i and conflict(t, other)} for i, t in enumerate(pool)]
        self._banned: set[tuple[tuple[int, ...], int]] = set()

    def state(self, members: Sequence[int], scale: int) -> State:
        """A set with all that follows from it."""
        members = tuple(sorted(members))
        at = [self._at[i] for i in members]
        prior = [self._prior[i] for i in members]
        if INEXACT[scale]:
            at.append(self.left_out.inexact)
            prior.append(self.problem.prior / INEXACT[scale] ** 2)
        at.append(self.left_out.unknown)
        prior.append(np.tile(never_known.prior(INEXACT[scale]), self.left_out.joints))
        where = np.concatenate(at)
        predicted = self.left_out.of(where, np.concatenate(prior))
        narrowed = self._narrowed(predicted) if INEXACT[scale] else 0.0
        return State(members, scale, predicted, narrowed, self._score(predicted.likelihood, members) - narrowed)

    def _narrowed(self, predicted: Predicted) -> float:
        """Occam's factor of the inexact links, less what their parameters cost the predictions already."""
        own = np.flatnonzero(np.isin(predicted.at, self.left_out.inexact))
        part = np.mean(predicted.covariance[:, own[:, None], own], axis=0) * predicted.prior[own]
        return -0.5 * float(np.linalg.slogdet(part)[1]) - (len(own) - float(np.trace(part)))

    def _score(self, likelihood: FloatArray, members: Sequence[int]) -> float:
        return float(np.sum(likelihood)) + self.prior.log([self.pool[i] for i in members])

    def fit(self, state: State, noise: Noise | None = None) -> Fit:
        """The fitted rows with a set."""
        self.problem.scale = INEXACT[state.scale] or 1.0
        terms = [self.pool[i] for i in state.members]
        return self.problem.fit(terms, noise or self.noise, 0, inexact=INEXACT[state.scale] > 0.0)

    def climb(self, state: State, thorough: bool = True) -> State:
        """The best set that single moves reach, then moves of several terms if it is to be thorough, then single ones again."""
        state = self._settled(state.members, state.scale) or self.state((), state.scale)
        for _ in range(_MOVES):
            better = self._step(state, self.single(state))
            if better is None and thorough:
                better = self._step(state, self._several(state))
            if better is None:
                break
            state = better
        return state

    def _step(self, state: State, moves: list[tuple[float, tuple[int, ...], int]]) -> State | None:
        for score, members, scale in sorted(moves, reverse=True)[:_TRIED]:
            if score < state.score + _LEAST:
                break
            found = self._settled(members, scale, state)
            if found is not None and found.score > state.score + _LEAST:
                return found
        return None

    def _settled(self, members: Sequence[int], scale: int, before: State | None = None) -> State | None:
        """The set without terms that are not allowed; None where a new one is not."""
        members = tuple(sorted(members))
        old = set(before.members) if before else set(members)
        while True:
            if (members, scale) in self._banned:
                return None
            state = self.state(members, scale)
            fit = self.fit(state)
            wrong = [i for i in members if not self._allowed(fit, self.pool[i])]
            if not wrong:
                return state
            if any(i not in old for i in wrong):
                self._banned.add((members, scale))
                return None
            members = tuple(i for i in members if i not in wrong[:1])

    def single(self, state: State) -> list[tuple[float, tuple[int, ...], int]]:
        """Score and members of each set that has one term more or less, or another inexactness."""
        moves = [(self._score(x, m) - state.narrowed, m, state.scale) for m, x in self.neighbours(state)]
        for scale in (state.scale - 1, state.scale + 1):
            if 0 <= scale < len(INEXACT):
                moves.append((self.state(state.members, scale).score, state.members, scale))
        return moves

    def neighbours(self, state: State) -> list[tuple[tuple[int, ...], FloatArray]]:
        """Members and likelihood of each set that has one term more (in place of what excludes it) or less."""
        out = []
        members = set(state.members)
        lesser: dict[frozenset[int], Predicted] = {frozenset(): state.predicted}

        def less(gone: frozenset[int]) -> Predicted:
            if gone not in lesser:
                lesser[gone] = self.left_out.without(state.predicted, self._where(state, gone))
            return lesser[gone]

        for i in range(len(self.pool)):
            if i in members:
                out.append((tuple(k for k in state.members if k != i), less(frozenset({i})).likelihood))
            else:
                gone = frozenset(self._against[i] & members)
                likelihood = self.left_out.plus(less(gone), self._at[i], self._prior[i])
                out.append((tuple(sorted((members - gone) | {i})), likelihood))
        return out

    def _where(self, state: State, gone: Collection[int]) -> Indices:
        sizes = np.cumsum([0, *(self.pool[k].p for k in state.members)])
        parts = [np.arange(sizes[n], sizes[n + 1]) for n, k in enumerate(state.members) if k in gone]
        return np.concatenate(parts)

    def _several(self, state: State) -> list[tuple[float, tuple[int, ...], int]]:
        """Sets with an effect on all joints or on none, with one term in place of another or of two, and without two."""
        moves = []
        members = set(state.members)

        def moved(gone: set[int], new: set[int]) -> None:
            less = self.left_out.without(state.predicted, self._where(state, gone)) if gone else state.predicted
            likelihood = less.likelihood
            if new:
                at = np.concatenate([self._at[i] for i in sorted(new)])
                likelihood = self.left_out.plus(less, at, np.concatenate([self._prior[i] for i in sorted(new)]))
            found = tuple(sorted((members - gone) | new))
            moves.append((self._score(likelihood, found) - state.narrowed, found, state.scale))

        for kind in dict.fromkeys(t.kind for t in self.pool if t.row is not None):
            own = {i for i in self._best_of_each_joint(state, kind) if not self._against[i] & members}
            if len(own - members) > 1:
                moved(set(), own - members)
            present = {i for i in members if self.pool[i].kind is kind and self.pool[i].row is not None}
            if len(present) > 1:
                moved(present, set())
            for other in forms_of(kind.family):
                rows = {self.pool[i].row for i in present}
                others = {i for i in self._best_of_each_joint(state, other) if self.pool[i].row in rows}
                if other is not kind and len(others) > 1:
                    replaced = {i for i in present if self.pool[i].row in {self.pool[k].row for k in others}}
                    moved(replaced, {i for i in others if not self._against[i] & (members - replaced)})
        few = [k for k in state.members if not self.pool[k].expected]
        for found, likelihood in self._replaced(state, few):
            moves.append((self._score(likelihood, found) - state.narrowed, found, state.scale))
        for k in few:
            beside = [m for m in state.members if m != k and self.pool[m].row == self.pool[k].row is not None]
            forms = [i for i, t in enumerate(self.pool) if i != k and t.key == self.pool[k].key]
            for i, m in product(forms, beside):
                moved({k, m}, {i})
        for a, b in combinations(few, 2):
            if len(few) <= 2 * _TRIED and self._overlap(a, b):
                moved({a, b}, set())
        return moves

    def _best_of_each_joint(self, state: State, kind: type[Effect]) -> list[int]:
        """Of the terms of an effect on each joint the one that is in the set, else the last that was proposed."""
        out: dict[int, int] = {}
        for i, t in enumerate(self.pool):
            if t.kind is kind and t.row is not None and (t.row not in out or out[t.row] not in state.members):
                out[t.row] = i
        return list(out.values())

    def _overlap(self, i: int, k: int) -> bool:
        a, b = self.pool[i], self.pool[k]
        return a.row is None or b.row is None or a.row == b.row

    def posterior(self, state: State) -> Posterior:
        """How probable each term of a set is, the others given: against the sets without it, or with another in its place.

        The stretches are drawn again and again with the weights of the Bayesian bootstrap (pseudo-BMA+, Yao, Vehtari, Simpson,
        Gelman 2018): what a few of them decide is not sure.
        """
        rng = np.random.default_rng(0)
        weights = rng.dirichlet(np.ones(self.left_out.stretches), _DRAWS) * self.left_out.stretches
        own = state.predicted.likelihood
        here = self.prior.log([self.pool[i] for i in state.members])
        rivals: dict[int, list[tuple[str, FloatArray]]] = {i: [] for i in state.members}
        for members, likelihood in [*self.neighbours(state), *self._replaced(state, state.members)]:
            odds = weights @ (likelihood - own) + self.prior.log([self.pool[i] for i in members]) - here
            new = [i for i in members if i not in state.members]
            for i in set(state.members) - set(members):
                rivals[i].append((self.pool[new[0]].id if new else "", odds))
        probability: dict[Term, float] = {}
        nothing: dict[Term, float] = {}
        instead: dict[Term, dict[str, float]] = {}
        for i, others in rivals.items():
            term = self.pool[i]
            odds = np.exp(np.clip(np.stack([o for _, o in others]), -700.0, 700.0))
            share = np.mean(odds / (1.0 + np.sum(odds, axis=0)), axis=1)
            same = sum(s for (name, _), s in zip(others, share, strict=True) if EFFECTS.get(name) is term.kind)
            probability[term] = float(min(1.0 - np.sum(share) + same, 1.0))
            nothing[term] = float(sum(s for (name, _), s in zip(others, share, strict=True) if not name))
            instead[term] = {}
            for (name, _), s in zip(others, share, strict=True):
                if name and EFFECTS[name] is not term.kind:
                    instead[term][name] = instead[term].get(name, 0.0) + float(s)
        return Posterior(probability, nothing, instead)

    def _replaced(self, state: State, gone: Sequence[int]) -> list[tuple[tuple[int, ...], FloatArray]]:
        """Sets in which a term takes the place of one of some that loads the same joints."""
        out = []
        for k in gone:
            rest = tuple(i for i in state.members if i != k)
            without = self.left_out.without(state.predicted, self._where(state, {k}))
            for i in range(len(self.pool)):
                if i in state.members or self._against[i] & set(rest) or not self._overlap(i, k):
                    continue
                out.append((tuple(sorted((*rest, i))), self.left_out.plus(without, self._at[i], self._prior[i])))
        return out


def conflict(term: Term, other: Term) -> bool:
    """True where two terms can't stand in one set."""
    if term.row is not None and other.row is not None and term.row != other.row:
        return False
    same = term.key == other.key and (term.instant is None or term.excludes(other))
    part = term.row is not None and term.row == other.row and (_includes(term, other) or _includes(other, term))
    return same or part or term.excludes(other) or other.excludes(term)


def _includes(term: Term, other: Term) -> bool:
    return any(EFFECTS[x] is other.kind for x in term.kind.includes)
