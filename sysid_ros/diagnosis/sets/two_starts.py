"""A search from two starts: from what is usual on every joint, and from there with a cause of several joints."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy

from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.scoring import Proposal
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import Scope

_REFRESHED = 3
"""Times that torques are taken in before two sets are compared."""
Progress = Callable[[str], None]


def most_probable(train: Prepared, library: Library, progress: Progress) -> Selection:
    """The search that ends at the more probable set of two: one from its own start and, if the cause of several joints that was
    the likeliest there is not in what it finds, one from there with that cause.

    What single joints have often stands in for such a cause, on all of them together better than the cause does alone, and no
    step that changes a few of them leads back.
    """
    problem, scale = train.problem, train.problem.scale
    one = Selection(problem, library, train.nominal, progress)
    one.run()
    one = _with_simpler(one, train, library, progress)
    shared = max((p for p in one.first if p.terms[0].row is None), key=lambda p: p.score, default=None)
    if shared is None or {t.key for t in shared.terms} <= {t.key for t in one.fit.terms} or _rivals(one, shared):
        return one
    progress(f"beginning again with {shared.words}")
    its_scale, problem.scale = problem.scale, scale
    problem.correct(None)
    library.lean((), ())
    other = Selection(problem, library, train.nominal, progress)
    other.pool = [library.remake(t) for t in one.pool]
    terms = [*other.fit.terms, *(library.remake(t) for t in shared.terms)]
    other.fit = problem.fit(terms, other.fit.noise, inexact=True)
    other.refresh()
    other.run()
    if _score(other) > _score(one):
        return other
    problem.scale = its_scale
    one.refresh()
    return one


def _with_simpler(one: Selection, train: Prepared, library: Library, progress: Progress) -> Selection:
    """The search that goes on from another form of a cause that all joints share, such as efforts that are filtered and not late,
    where that is likelier with the simplest form of what every joint has. Richer forms on each joint stand in for it."""
    problem, best, most = train.problem, None, _score(one)
    for proposal in one.first:
        if not (rivals := _rivals(one, proposal)):
            continue
        stays = [t for t in one.fit.terms if t not in rivals]
        simple = [library.local(s.id, t.row) if (s := t.simplest) and t.row is not None else t for t in stays]
        other = copy(one)
        other.fit = problem.fit([*simple, *(library.remake(t) for t in proposal.terms)], one.fit.noise, inexact=True)
        for _ in range(_REFRESHED):
            other.refresh(pool=False)
        if _score(other) > most:
            best, most = other, _score(other)
        one.refresh(pool=False)
    if best is None:
        return one
    progress(f"going on with {', '.join(t.effect.label for t in best.fit.terms if t.row is None)}")
    best.refresh()
    best.run()
    return best


def _rivals(one: Selection, proposal: Proposal) -> list[Term]:
    """What a search found in place of a proposal: other forms of a cause that all joints share."""
    shared = [t for t in proposal.terms if t.kind.scope is Scope.ARM]
    own, families = {_form(t) for t in shared}, {t.effect.family for t in shared} - {""}
    found = [t for t in one.fit.terms if t.kind.scope is Scope.ARM and t.effect.family in families]
    return [t for t in found if _form(t) not in own]


def _form(term: Term) -> tuple[str, str]:
    knobs = {k: x for k, x in term.effect.settings.items() if k != "around"}
    return term.id, repr(sorted(knobs.items()))


def _score(selection: Selection) -> float:
    """Likelihood of the rows with the present set, less what its parameters cost a prediction and how unusual it is."""
    fit = selection.fit
    return fit.loglik - sum(t.cost for t in fit.terms) + selection.prior.log(fit.terms)
