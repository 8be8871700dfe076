"""Rival forms of a cause that all joints share, such as efforts that are filtered and not late: sets with rows of their own.

What makes efforts late changes the rows, or all columns beside it (:mod:`..corrections`). Columns of another form on those rows
are not what it would explain in its place, so that each is fitted with its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Protocol, TypeVar

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.fit import Fit, Problem, allowed
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.set_search import SetSearch
from sysid_ros.diagnosis.sets.posterior import Anew, Posterior, posterior_of
from sysid_ros.diagnosis.sets.state import State, Weighed
from sysid_ros.diagnosis.sets.stretches import Rows
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import Scope, named

_REFRESHED = 3
"""Times that torques are taken in before two sets are compared."""


class Searching(Protocol):
    """What is asked of a search here."""

    problem: Problem
    library: Library
    fit: Fit
    pool: list[Term]

    def refresh(self, pool: bool = True) -> None:
        """Make columns and rows anew with the present fit."""

    def among(self, rows: Sequence[Rows], asked: Sequence[Term], noise: RowNoise) -> tuple[SetSearch, State]:
        """A search among the fit's terms and others, and its state at the fit."""


S = TypeVar("S", bound=Searching)


def rivals(present: Sequence[Term], terms: Sequence[Term]) -> list[Term]:
    """Present terms that others would stand in place of: other forms of a cause that all joints share."""
    shared = [t for t in terms if t.kind.scope is Scope.ARM]
    own, families = {_form(t) for t in shared}, {t.effect.family for t in shared} - {""}
    found = [t for t in present if t.kind.scope is Scope.ARM and t.effect.family in families]
    return [t for t in found if _form(t) not in own]


def in_place(one: S, stays: Sequence[Term], new: Sequence[Term]) -> S:
    """A search with some terms, and others with rows of their own. Rows and library are then those of what is returned, until
    ``one`` is refreshed."""
    other = copy(one)
    terms = [*stays, *(one.library.remake(t) for t in new)]
    other.fit = one.problem.fit(terms, one.fit.noise, inexact=one.fit.inexact)
    for _ in range(_REFRESHED):
        other.refresh(pool=False)
    return other


def weighed(
    one: Searching, held: HeldOut, rows: Sequence[Rows], anew: Anew, search: SetSearch, state: State, *others: State
) -> Posterior:
    """:func:`.posterior_of` the fit of ``one``, at which ``state`` is, against such forms too."""
    return posterior_of(search, state, *others, anew=anew, elsewhere=_on_their_own_rows(one, held, rows, search, state))


def _on_their_own_rows(one: Searching, held: HeldOut, rows: Sequence[Rows], search: SetSearch, state: State) -> list[Weighed]:
    """Sets with another form of such a cause, each fitted with its own rows."""
    out: dict[tuple[int, tuple[str, str]], Weighed] = {}
    own = [search.pool[i] for i in state.members]
    for k, new in enumerate(search.pool):
        for term in rivals(own, [new]) if k not in state.members else []:
            at = own.index(term)
            if (at, _form(new)) in out:
                continue
            other = in_place(one, [t for i, t in enumerate(one.fit.terms) if i != at], [new])
            if allowed(one.problem, other.fit, other.fit.terms[-1]):
                held.update(other.fit)
                found = other.among(rows, (), search.noise)[1]
                members = tuple(sorted({*state.members, k} - {state.members[at]}))
                out[at, _form(new)] = Weighed(members, state.scale, found.likelihood, found.narrowed, 0.0)
            one.refresh(pool=False)
            held.update(one.fit)
    return list(out.values())


def in_likeliest_form(one: Searching, held: HeldOut, judge: Callable[[HeldOut], Posterior]) -> Posterior:
    """What is judged, judged again where another form of such a cause turns out more probable than the one that was found."""
    posterior = judge(held)
    return judge(held) if _take_likelier_form(one, posterior, held) else posterior


def _take_likelier_form(one: Searching, posterior: Posterior, held: HeldOut) -> bool:
    """Go on with another form where that is the more probable one; False where none is."""
    for at, term in enumerate(one.fit.terms):
        likelier = {named(name) for name, p in posterior.instead.get(term, {}).items() if p > posterior.probability[term]}
        fits = list[Fit]()
        for new in [t for t in one.pool if t.kind in likelier and rivals([term], [t])]:
            fits.append(in_place(one, [t for i, t in enumerate(one.fit.terms) if i != at], [new]).fit)
            one.refresh(pool=False)
        if lawful := [fit for fit in fits if allowed(one.problem, fit, fit.terms[-1])]:
            one.fit = max(lawful, key=lambda fit: fit.loglik)
            one.refresh()
            held.update(one.fit)
            return True
    return False


def _form(term: Term) -> tuple[str, str]:
    knobs = {k: x for k, x in term.effect.settings.items() if k != "around"}
    return term.id, repr(sorted(knobs.items()))
