"""The search over sets of causes: which set is the most probable, and how probable each of its causes is."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from itertools import islice

import numpy as np
from scipy import special

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.fit import Estimated, Fit, Problem
from sysid_ros.diagnosis.left_out import LeftOut
from sysid_ros.diagnosis.prepare import SCALES, scales_beside
from sysid_ros.diagnosis.sets.link_scales import LinkScales, occam_factor
from sysid_ros.diagnosis.sets.moves import instead_of, several
from sysid_ros.diagnosis.sets.never_known import unknown_priors
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.sets.state import Move, Parameters, State, Weighed
from sysid_ros.diagnosis.sets.stretches import Indices, Rows
from sysid_ros.diagnosis.term import Term, conflicts
from sysid_ros.sample import FloatArray

_MOVES, _TRIED = 200, 6
"""Most moves, and those of one kind that are tried in full where physics allows them, the best first."""
_LEAST = 0.05
"""Log-probability by which a move must be better."""
Allowed = Callable[[Estimated, Term], bool]


class SetSearch:
    """Sets of terms from a pool, judged by what they predict of stretches that were left out and by how usual they are.

    Args:
        problem: the fitted rows. rows: the rows that are predicted, the fitted ones among them. pool: all terms.
        noise, dry: as :class:`LeftOut` has them.
        allowed: False for a term that physics does not allow with the parameters that it has in a set.
    """

    def __init__(
        self,
        problem: Problem,
        rows: Sequence[Rows],
        pool: Sequence[Term],
        prior: SetPrior,
        noise: RowNoise,
        dry: FloatArray,
        allowed: Allowed,
    ) -> None:
        self.problem, self.pool, self.prior, self._allowed = problem, list(pool), prior, allowed
        self.noise = noise
        self.left_out = LeftOut(rows, pool, noise, dry)
        self._at = [np.arange(s.start, s.stop) for s in self.left_out.of_each.slices]
        self._prior = [t.prior for t in pool]
        self._number = np.array([prior.number(t) for t in pool], dtype=np.intp)
        self._cost = prior.costs(pool, noise.along(problem.band), problem.active)
        self._against = conflicts(pool)
        self._banned: set[tuple[tuple[int, ...], int]] = set()
        self._weighed: dict[tuple[tuple[int, ...], int], Weighed] = {}
        self._state: State | None = None
        self._last_scales: tuple[tuple[int, ...], LinkScales] | None = None

    @classmethod
    def from_fit(
        cls,
        problem: Problem,
        fit: Fit,
        rows: Sequence[Rows],
        asked: Sequence[Term],
        prior: SetPrior,
        noise: RowNoise,
        dry: FloatArray,
        allowed: Allowed,
    ) -> tuple[SetSearch, State]:
        """A search among a fit's terms and others, and its state at the fit."""
        pool = [*fit.terms, *(t for t in asked if t not in fit.terms)]
        search = cls(problem, rows, pool, prior, noise, dry, allowed)
        return search, search.state(range(len(fit.terms)), SCALES.index(problem.scale) if fit.inexact else 0)

    def state(self, members: Sequence[int], scale: int) -> State:
        """A set with all that follows from it."""
        members = tuple(sorted(members))
        if self._state is not None and (self._state.members, self._state.scale) == (members, scale):
            return self._state
        where, prior = self._columns(members, scale)
        predicted, narrowed = self.left_out.of(where, prior), 0.0
        if self._is_inexact(scale):
            own = np.flatnonzero(np.isin(where, self.left_out.of_each.inexact))
            narrowed = occam_factor(predicted.covariance[self.left_out.of_each.fitted][:, own[:, None], own], prior[own])
        self._state = State(members, scale, predicted, narrowed, self._score(predicted.likelihood, members, scale) - narrowed)
        return self._state

    def _is_inexact(self, scale: int) -> bool:
        """True where links so inexact are columns of their own."""
        return scale > 0 or self.problem.considered > 0

    def _columns(self, members: Sequence[int], scale: int, free: Sequence[int] = ()) -> tuple[Indices, FloatArray]:
        """Columns of a set with what is never known of a joint, shape (a,), and inverse variances; ``free``: unknown gains."""
        rows = self.left_out.of_each
        at, prior = [self._at[i] for i in members], [self._prior[i] for i in members]
        if self._is_inexact(scale):
            at.append(rows.inexact)
            prior.append(self.problem.prior_of(SCALES[scale]))
        unknown = unknown_priors(self.problem.active.tolist(), max(SCALES[scale]), free)[: len(rows.unknown)]
        return np.concatenate([*at, rows.unknown]), np.concatenate([*prior, unknown])

    def _score(self, likelihood: FloatArray, members: Sequence[int], scale: int) -> float:
        return float(np.sum(likelihood)) + self.usual(members, scale)

    def usual(self, members: Sequence[int], scale: int) -> float:
        """Log-probability of a set beside links so inexact before any data, up to a constant."""
        own = list(members)
        return self.prior.of(self.prior.counts(self._number[own]), float(np.sum(self._cost[own])), scale)

    def fit(self, members: Sequence[int], scale: int, noise: RowNoise | None = None) -> Fit:
        """The fitted rows with a set."""
        always = self.problem.considered > 0
        self.problem.scale = SCALES[scale if scale or always else SCALES.index((1.0, 1.0))]
        return self.problem.fit([self.pool[i] for i in members], noise or self.noise, 0, inexact=always or scale > 0)

    def climb(self, state: State, thorough: bool = True) -> State:
        """The best set that single moves reach, then moves of several terms if it is to be thorough, then single ones again."""
        state = self._settled(state.members, state.scale) or self.state((), state.scale)
        for _ in range(_MOVES):
            better = self._step(state, self.single(state)) or self._step(state, [self._rescaled(state.members, state.scale).move])
            if better is None and thorough:
                better = self._step(state, [*self._several(state), *(x.move for x in self.all_inexact(state))])
            if better is None:
                break
            state = better
        return state

    def _step(self, state: State, moves: list[Move]) -> State | None:
        better = (m for m in sorted(moves, reverse=True) if m[0] >= state.score + _LEAST)
        lawful = (found for _, members, scale in better if (found := self._settled(members, scale, state)) is not None)
        return next((found for found in islice(lawful, _TRIED) if found.score > state.score + _LEAST), None)

    def _settled(self, members: Sequence[int], scale: int, before: State | None = None) -> State | None:
        """The set without terms that are not allowed; None where a new one is not."""
        members = tuple(sorted(members))
        old = set(before.members) if before else set(members)
        while True:
            if (members, scale) in self._banned:
                return None
            wrong = self._wrong(members, scale)
            if not wrong:
                return self.state(members, scale)
            if any(i not in old for i in wrong):
                self._banned.add((members, scale))
                return None
            members = tuple(i for i in members if i not in wrong[:1])

    def lawful(self, members: Sequence[int], scale: int) -> tuple[int, ...]:
        """A set less the terms that physics does not allow beside the others."""
        members = tuple(sorted(members))
        while wrong := self._wrong(members, scale):
            members = tuple(i for i in members if i != wrong[0])
        return members

    def _wrong(self, members: Sequence[int], scale: int) -> list[int]:
        where, prior = self._columns(members, scale)
        own = ~np.isin(where, self.left_out.of_each.unknown)
        covariance, theta = self.left_out.with_all(where[own], prior[own])
        known = Parameters(tuple(self.pool[i] for i in members), theta, covariance)
        return [i for i in members if not self._allowed(known, self.pool[i])]

    def single(self, state: State) -> list[Move]:
        """Score and members of each set that has one term more or less."""
        worth = self._worth_a_look(state)
        return [(self._score(x, m, state.scale) - state.narrowed, m, state.scale) for m, x in self.neighbours(state, worth)]

    def all_inexact(self, state: State) -> list[Weighed]:
        """Sets with the best scale of all links in place of one that is wrong, or of a body that is carried, or of all these; and
        beside another link in place of one that is wrong, the best of these."""
        old, link = set(state.members), [t.effect.replaces_links for t in self.pool]
        links = {i for i in state.members if link[i] or self.pool[i].effect.carried}
        rest = {tuple(i for i in state.members if i not in gone) for gone in [*({i} for i in links), links]} - {state.members}
        other = [m for m in self.replaced(state, sorted(links)) if any(link[i] for i in set(m[0]) - old)]
        rest |= {members for members, _ in sorted(other, key=lambda m: -self._score(m[1], m[0], state.scale))[:_TRIED]}
        return [self._rescaled(members, state.scale) for members in rest]

    def _rescaled(self, members: tuple[int, ...], scale: int) -> Weighed:
        """A set with the best inexactness of the links that steps lead to from one."""
        (best,), before = self.at_scales(members, [scale]), None
        while best is not before:
            before = best
            best = max([best, *self.at_scales(members, scales_beside(best.scale))], key=lambda x: x.score)
        return best

    def at_scales(self, members: tuple[int, ...], scales: Sequence[int]) -> list[Weighed]:
        """A set with links as inexact as each of some scales says."""
        new = [k for k in scales if (members, k) not in self._weighed]
        if inexact := [k for k in new if self._is_inexact(k)]:
            for k, likelihood, narrowed in zip(inexact, *self._link_scales(members).of(inexact), strict=True):
                score = self._score(likelihood, members, k) - narrowed
                self._weighed[members, k] = Weighed(members, k, likelihood, narrowed, score)
        for k in (k for k in new if not self._is_inexact(k)):
            exact = self.state(members, k)
            self._weighed[members, k] = Weighed(members, k, exact.likelihood, exact.narrowed, exact.score)
        return [self._weighed[members, k] for k in scales]

    def odds_of_scales(self, members: Sequence[int]) -> FloatArray:
        """Probability of each inexactness of the links beside a set, shape (scales,): the marginal likelihood of all fitted rows.

        How well stretches are predicted tells which causes there are; by how much links are off is a matter of what they are off
        by, which a prior that is too narrow predicts no worse.
        """
        members = tuple(sorted(members))
        out = np.empty(len(SCALES))
        for k in range(len(SCALES)):
            at, prior = self._columns(members, k, self.problem.gains)
            never = np.isin(at, [*self.left_out.of_each.inexact, *self.left_out.of_each.unknown])  # what the scale is of
            out[k] = self.left_out.marginal(at, prior) + 0.5 * float(np.sum(np.log(prior[never]))) + self.usual(members, k)
        return np.asarray(special.softmax(out))

    def _link_scales(self, members: tuple[int, ...]) -> LinkScales:
        if self._last_scales is None or self._last_scales[0] != members:
            # exact links, the first scale, have no columns: their row of the priors is that of the next, and is not asked for
            each = [self._columns(members, k if self._is_inexact(k) else 1) for k in range(len(SCALES))]
            self._last_scales = members, LinkScales(self.left_out, each[0][0], np.stack([prior for _, prior in each]))
        return self._last_scales[1]

    def _worth_a_look(self, state: State) -> set[int]:
        """Terms that the most probable set may have more or less: the bound of what the rows gain does not say no."""
        own, here, out = set(state.members), self.usual(state.members, state.scale), set()
        groups: dict[tuple[int, ...], list[int]] = {(k,): [] for k in state.members}
        for i in range(len(self.pool)):
            if i not in own:
                groups.setdefault(tuple(sorted(self._against[i] & own)), []).append(i)
        for gone, new in groups.items():
            at, prior, rest = [self._at[i] for i in new], [self._prior[i] for i in new], own - set(gone)
            sets = [(i, rest | {i}) for i in new]
            where = self._where(state, gone) if gone else np.zeros(0, dtype=np.intp)
            if len(gone) == 1:  # it alone may leave, too
                sets, at, prior = [*sets, (gone[0], rest)], [*at, where[:0]], [*prior, np.zeros(0)]
            most = self.left_out.most(state.predicted, where, at, prior)
            out |= {i for (i, found), gain in zip(sets, most, strict=True) if gain > here - self.usual(tuple(found), state.scale)}
        return out

    def neighbours(self, state: State, among: Collection[int] | None = None) -> list[tuple[tuple[int, ...], FloatArray]]:
        """Members and likelihood of each set that has one term more (in place of what excludes it) or less, ``among`` some."""
        out = []
        members = set(state.members)
        instead: dict[frozenset[int], list[int]] = {}
        for i in range(len(self.pool)) if among is None else sorted(among):
            if i in members:
                less = self.left_out.likelihood_without(state.predicted, self._where(state, {i}))
                out.append((tuple(k for k in state.members if k != i), less))
            else:
                instead.setdefault(frozenset(self._against[i] & members), []).append(i)
        for gone, new in instead.items():
            out += self._with_one_of(state, gone, new)
        return out

    def without_effect(self, state: State) -> list[tuple[tuple[int, ...], FloatArray]]:
        """Members and likelihood of each set without an effect that several joints have."""
        out = []
        for kind in dict.fromkeys(self.pool[i].kind for i in state.members):
            gone = {i for i in state.members if self.pool[i].kind is kind}
            if len(gone) > 1:
                less = self.left_out.likelihood_without(state.predicted, self._where(state, gone))
                out.append((tuple(i for i in state.members if i not in gone), less))
        return out

    def _with_one_of(self, state: State, gone: Collection[int], new: Sequence[int]) -> list[tuple[tuple[int, ...], FloatArray]]:
        """Members and likelihood of the sets without some terms and with one of several others."""
        less = self.left_out.without(state.predicted, self._where(state, gone)) if gone else state.predicted
        likelihood = self.left_out.plus(less, [self._at[i] for i in new], [self._prior[i] for i in new])
        rest = set(state.members) - set(gone)
        return [(tuple(sorted(rest | {i})), x) for i, x in zip(new, likelihood, strict=True)]

    def _where(self, state: State, gone: Collection[int]) -> Indices:
        sizes = np.cumsum([0, *(self.pool[k].p for k in state.members)])
        parts = [np.arange(sizes[n], sizes[n + 1]) for n, k in enumerate(state.members) if k in gone]
        return np.concatenate(parts)

    def _several(self, state: State) -> list[Move]:
        """Sets with an effect on all joints or on none, one term in place of another or of two, two in place of one, less two."""
        wanted = several(self.pool, self._against, state.members, most_pairs=2 * _TRIED)
        each = [x for gone, new in wanted.items() for x in self._in_place(state, gone, new)]
        return [(self._score(likelihood, found, state.scale) - state.narrowed, found, state.scale) for found, likelihood in each]

    def _in_place(
        self, state: State, gone: frozenset[int], each: Sequence[list[int]]
    ) -> list[tuple[tuple[int, ...], FloatArray]]:
        """Members and likelihood of the sets with groups of others, empty ones among them, in place of some terms."""
        rest, some = set(state.members) - gone, [new for new in each if new]
        less = self.left_out.without(state.predicted, self._where(state, gone)) if gone else state.predicted
        at, prior = ([np.concatenate([x[i] for i in new]) for new in some] for x in (self._at, self._prior))
        likelihood = self.left_out.plus(less, at, prior)
        out = [(tuple(sorted(rest.union(new))), x) for new, x in zip(some, likelihood, strict=True)]
        return out if len(some) == len(each) else [*out, (tuple(sorted(rest)), less.likelihood)]

    def replaced(self, state: State, gone: Sequence[int]) -> list[tuple[tuple[int, ...], FloatArray]]:
        """Sets in which a term takes the place of one of some that loads the same joints."""
        out = []
        for k in gone:
            if new := instead_of(self.pool, self._against, state.members, k):
                out += self._with_one_of(state, {k}, new)
        return out
