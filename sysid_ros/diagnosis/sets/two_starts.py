"""A search from two starts: from what is usual on every joint, and from there with a cause of several joints."""

from __future__ import annotations

from collections.abc import Callable

from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.selection import Selection


def most_probable(train: Prepared, library: Library, progress: Callable[[str], None]) -> Selection:
    """The search that ends at the more probable set of two: one from its own start and, if the cause of several joints that was
    the likeliest there is not in what it finds, one from there with that cause.

    What single joints have often stands in for such a cause, on all of them together better than the cause does alone, and no
    step that changes a few of them leads back.
    """
    problem, scale = train.problem, train.problem.scale
    one = Selection(problem, library, train.nominal, progress)
    found = one.run()
    shared = max((p for p in one.first if p.terms[0].row is None), key=lambda p: p.score, default=None)
    if shared is None or {t.key for t in shared.terms} <= {t.key for t in found.terms}:
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


def _score(selection: Selection) -> float:
    """Likelihood of the rows with the present set, less what its parameters cost a prediction and how unusual it is."""
    fit = selection.fit
    return fit.loglik - sum(t.cost for t in fit.terms) + selection.prior.log(fit.terms)
