"""A search from two starts: from what is usual on every joint, and from there with a cause of several joints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sysid_ros.diagnosis.fit import allowed
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.selection import Selection
from sysid_ros.diagnosis.sets.rival_forms import in_place, rivals

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
    one = _with_simpler(one, library, progress)
    shared = max((p for p in one.first if p.terms[0].row is None), key=lambda p: p.score, default=None)
    if shared is None or {t.key for t in shared.terms} <= {t.key for t in one.fit.terms} or rivals(one.fit.terms, shared.terms):
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


def _with_simpler(one: Selection, library: Library, progress: Progress) -> Selection:
    """The search that goes on from another form of a cause that all joints share, such as efforts that are filtered and not late,
    where that is likelier with the simplest form of what every joint has, or with nothing else beside that. Richer forms on each
    joint stand in for it, and springs for what it lacks."""
    best, most = None, _score(one)
    for proposal in one.first:
        if not (others := rivals(one.fit.terms, proposal.terms)):
            continue
        stays = [t for t in one.fit.terms if t not in others]
        simple = [library.local(s.id, t.row) if (s := t.simplest) and t.row is not None else t for t in stays]
        plain = [t for t in simple if t.expected]
        for beside in [simple, plain] if len(plain) < len(simple) else [simple]:
            other = in_place(one, beside, proposal.terms)
            its = other.fit.terms[len(beside) :]
            if _score(other) > most and all(allowed(one.problem, other.fit, t) for t in its):
                best, most = other, _score(other)
            one.refresh(pool=False)
    if best is None:
        return one
    progress(f"going on with {', '.join(t.effect.label for t in best.fit.terms if t.row is None)}")
    best.refresh()
    best.run()
    return best


def _score(selection: Selection) -> float:
    """Likelihood of the rows with the present set, less what its parameters cost a prediction and how unusual it is, with the
    sizes that it has."""
    fit, prior = selection.fit, selection.prior
    costs = prior.costs(fit.terms, fit.variance, selection.problem.active)
    counts = prior.counts([prior.number(t) for t in fit.terms])
    return fit.loglik - sum(t.cost for t in fit.terms) + prior.of(counts, float(np.sum(costs)))
