"""The search over sets of causes in the rows of a robot on legs: all candidates are few enough to be asked at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem, allowed
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.legs.leg_rows import LegLibrary
from sysid_ros.diagnosis.library import Library, SetPrior
from sysid_ros.diagnosis.posterior import Posterior, posterior_of
from sysid_ros.diagnosis.prepare import SCALES
from sysid_ros.diagnosis.set_search import SetSearch, State
from sysid_ros.diagnosis.term import Term

_ROUNDS = 6
"""Most rounds of the search, each with the noise that the one before left."""

Progress = Callable[[str], None]


@dataclass(eq=False)
class LegSelection:
    """The most probable set.

    Attributes:
        library: its candidates. fit: the set on the fitted rows. tried: number of candidates.
    """

    library: Library
    fit: Fit
    tried: int


def search_legs(
    train: LegLibrary, judged: LegLibrary, progress: Progress = lambda sentence: None
) -> tuple[LegSelection, Posterior, HeldOut]:
    """The most probable set of causes, how probable each of them is, and what it is judged on.

    As :meth:`.Selection.judged_with`: fitted rows by what is predicted of them without each stretch, held-out ones by all that
    are fitted. What nothing in its place explains as well is left out, and the rest is asked again.
    """
    pool = train.candidates()
    held = HeldOut(judged.prepared, judged, {t: judged.remake(t) for t in pool})
    prior = SetPrior.of_places(train.places(), len(train.band.f))
    asked = pool
    while True:
        state, fit, search = _climbed(train.prepared.problem, held, asked, prior, progress)
        posterior = posterior_of(search, state)
        asked = [t for t in asked if posterior.nothing.get(t, 0.0) < 0.5]
        if all(p < 0.5 for p in posterior.nothing.values()):
            return LegSelection(train, fit, len(pool)), posterior, held


def _climbed(
    problem: Problem, held: HeldOut, pool: Sequence[Term], prior: SetPrior, progress: Progress
) -> tuple[State, Fit, SetSearch]:
    """The most probable set of a pool, with the noise that it leaves."""
    rows = [(problem, lambda term: term), (held.prepared.problem, lambda term: held.terms[term])]
    noise, dry = problem.fit([], inexact=True).noise, np.zeros(problem.band.n)
    members, scale = tuple[int, ...](), SCALES.index((1.0, 1.0))
    for turn in range(_ROUNDS):
        search = SetSearch(problem, rows, pool, prior, noise, dry, partial(allowed, problem))
        state = search.climb(search.state(members, scale))
        named = list(dict.fromkeys(pool[i].effect.label for i in state.members))
        progress(f"round {turn + 1}: {', '.join(named) or 'nothing'}")
        noise = search.left_out.noise(state.predicted.left)
        if turn and state.members == members and state.scale == scale:
            break
        members, scale = state.members, state.scale
    return state, search.fit(state.members, state.scale, noise), search
