"""The search over sets of causes in the rows of a robot on legs: all candidates are few enough to be asked at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem, allowed
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.legs.leg_noise import Gait, NoiseOfEach
from sysid_ros.diagnosis.legs.leg_rows import LegLibrary
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import SCALES
from sysid_ros.diagnosis.set_search import SetSearch
from sysid_ros.diagnosis.sets.posterior import Posterior, posterior_of
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.sets.state import State
from sysid_ros.diagnosis.sets.stretches import Rows
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

_ROUNDS = 6
"""Most rounds of the search, each with the noise that the one before left."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows that are fitted, and those that judge, as the search has them.

    Attributes:
        problem: the fitted ones. each: all of them. gaits: of their recordings.
    """

    problem: Problem
    each: list[Rows]
    gaits: Mapping[str, Gait]

    def noise(self, left: Sequence[FloatArray]) -> NoiseOfEach:
        """The likeliest, of what is left of each rows, shape (K, n)."""
        return NoiseOfEach.of([(p.band, x) for (p, _), x in zip(self.each, left, strict=True)], self.gaits)

    def search(self, pool: Sequence[Term], prior: SetPrior, noise: NoiseOfEach) -> SetSearch:
        """Of sets from a pool."""
        dry = np.zeros(self.problem.band.n)
        return SetSearch(self.problem, self.each, pool, prior, noise, dry, partial(allowed, self.problem))


@dataclass(eq=False)
class LegSelection:
    """The most probable set.

    Attributes:
        library: its candidates. fit: the set on the fitted rows. tried: number of candidates. prior: of the sets.
    """

    library: Library
    fit: Fit
    tried: int
    prior: SetPrior


def search_legs(
    train: LegLibrary, judged: LegLibrary, progress: Progress = lambda sentence: None
) -> tuple[LegSelection, Posterior, HeldOut]:
    """The most probable set of causes, how probable each of them is, and what it is judged on.

    As :meth:`.Selection.judged_with`: fitted rows by what is predicted of them without each stretch, held-out ones by all that
    are fitted. What nothing in its place explains as well is left out, and the rest is asked again.
    """
    pool = train.candidates()
    held = HeldOut(judged.prepared, judged, {t: judged.remake(t) for t in pool})
    problem = train.prepared.problem
    rows = _Rows(
        problem,
        [(problem, lambda term: term), (held.prepared.problem, lambda term: held.terms[term])],
        {**train.gaits, **judged.gaits},
    )
    prior = SetPrior.of_places(train.places(), len(train.band.f))
    asked = pool
    while True:
        state, fit, search, noise = _climbed(rows, asked, prior, progress)
        posterior = _no_surer_than_a_step(rows, search, state, noise, prior, posterior_of(search, state))
        asked = [t for t in asked if posterior.nothing.get(t, 0.0) < 0.5]
        if all(p < 0.5 for p in posterior.nothing.values()):
            return LegSelection(train, fit, len(pool), prior), posterior, held


def _climbed(rows: _Rows, pool: Sequence[Term], prior: SetPrior, progress: Progress) -> tuple[State, Fit, SetSearch, NoiseOfEach]:
    """The most probable set of a pool, with the noise that it leaves of each recording."""
    noise = rows.noise([p.fit([], inexact=True).residual for p, _ in rows.each])
    members, scale = tuple[int, ...](), SCALES.index((1.0, 1.0))
    for turn in range(_ROUNDS):
        search = rows.search(pool, prior, noise)
        state = search.climb(search.state(members, scale))
        named = list(dict.fromkeys(pool[i].effect.label for i in state.members))
        progress(f"round {turn + 1}: {', '.join(named) or 'nothing'}")
        noise = rows.noise(search.left_out.of_each.rows(state.predicted.left))
        if turn and state.members == members and state.scale == scale:
            break
        members, scale = state.members, state.scale
    return state, search.fit(state.members, state.scale, noise), search, noise


def _no_surer_than_a_step(
    rows: _Rows, search: SetSearch, state: State, noise: NoiseOfEach, prior: SetPrior, found: Posterior
) -> Posterior:
    """The probabilities of a set where recordings hold steps, which tell each cause as a step does that was seen once.

    How large an error is that every step repeats is only known from what is left of them. Where a cause takes it away, nothing
    is left by which to be unsure; so each cause is asked with as much of it as there is without the cause. (With a level that
    is unknown, the log-likelihood lies between that and the one with the cause's own.)
    """
    if not noise.repeated:
        return found
    probability, nothing = dict(found.probability), dict(found.nothing)
    members = [search.pool[i] for i in state.members]
    for key in dict.fromkeys((t.kind, t.form) for t in members):
        group = [i for i in state.members if (search.pool[i].kind, search.pool[i].form) == key]
        rest = [i for i in state.members if i not in group]
        less = search.state(rest, state.scale)
        there = noise.repeating_as(rows.noise(search.left_out.of_each.rows(less.predicted.left)))
        again = rows.search(members, prior, there)
        both = [again.state([members.index(search.pool[i]) for i in own], state.scale).score for own in (state.members, rest)]
        sure = float(1.0 / (1.0 + np.exp(np.clip(both[1] - both[0], -700.0, 700.0))))
        for i in group:
            term = search.pool[i]
            probability[term] = min(probability[term], sure)
            nothing[term] = max(nothing[term], 1.0 - sure)
    return Posterior(probability, nothing, found.instead)
