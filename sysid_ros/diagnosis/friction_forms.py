"""Which form of dry friction a joint has: the simplest that explains it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.refine import refine
from sysid_ros.diagnosis.scoring import Scorer
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, forms_of

_SHARE = 0.002
"""A richer form must explain this part of the power of the friction torque that the simplest form leaves."""
_SHARE_OF_TEMPERATURE = 0.0002
"""The same of a form that follows a measured temperature: nothing else in a recording bends as that does."""
_STANDS_IN = 5.0
"""Likelihood by which time must be better than a measured temperature, for which it only stands in."""

_AMONG = 3.5
"""Likelihood that it must gain beyond its price: it is one of many forms on many joints."""
_CLEARLY = 5.0
"""Likelihood by which a curve must be better than a straight line."""
_TRIED = 4.0
"""Likelihood that a richer form must gain beside the present one before it is tried in its place."""


@dataclass(frozen=True, eq=False)
class Form:
    """A form of friction on a joint, the fit with it, and the power that is then left on the joint."""

    term: Term
    fit: Fit
    left: float


def forms(problem: Problem, library: Library, fit: Fit, present: Term) -> list[Form]:
    """Fits with each form of what ``present`` is a form of in its place, the simpler first; impossible ones are left out."""
    joint = present.row
    assert joint is not None
    others = [t for t in fit.terms if t is not present]
    scorer = Scorer(problem, problem.fit(others, fit.noise, 2, fit.inexact))
    beside = Scorer(problem, fit)
    found = []
    kinds = forms_of(present.effect.family)
    for kind in kinds:
        candidates = library.local_options(kind.id, joint)
        if kinds.index(kind) > kinds.index(present.kind):
            gains = [s.gain for s in beside.local(candidates)] if candidates else []
            if max(gains, default=0.0) < _TRIED:
                continue
        parts = {EFFECTS[x] for x in kind.includes}
        kept = [t for t in others if not (t.row == joint and t.kind in parts)]
        options = scorer.local(candidates) if candidates else []
        if not options:
            continue
        best = max(options, key=lambda s: s.gain).term
        trials = []
        for term in [best, *(s.term for s in options if s.term.effect.follows_temperature and s.term is not best)]:
            if kind is present.kind and present.effect.knobs and term.form == present.form:
                term = present
            trial = refine(problem, library, problem.fit([*kept, term], fit.noise, inexact=fit.inexact), [term])
            term = trial.terms[-1]
            if term.possible(trial.theta_of(term), trial.std_of(term)):
                trials.append(Form(term, trial, float(np.sum(trial.residual[:, joint] ** 2))))
        if trials:
            found.append(max(trials, key=lambda f: f.fit.loglik + (_STANDS_IN if f.term.effect.follows_temperature else 0.0)))
    return found


def simplest(found: list[Form], price: Callable[[Term], float]) -> Form:
    """The first form that no richer one beats by its price and by a part of the friction that can be seen.

    Args:
        found: the simpler ones first. price: likelihood that a term must gain.
    """
    best = found[0]
    base = best.term.columns @ best.fit.theta_of(best.term)
    power = float(np.sum(base**2))
    for form in found[1:]:
        gain = form.fit.loglik - best.fit.loglik - (price(form.term) - price(best.term))
        share = _SHARE_OF_TEMPERATURE if form.term.effect.follows_temperature else _SHARE
        if gain > _AMONG and best.left - form.left > share * power:
            best = form
    return best


def simplify(problem: Problem, library: Library, fit: Fit, joints: Sequence[int], price: Callable[[Term], float]) -> Fit:
    """The fit with the simplest form of everything that has several on a joint, as dry friction has, that explains the joint."""
    for joint in joints:
        for family in dict.fromkeys(t.effect.family for t in fit.terms if t.row == joint and t.effect.family):
            present = next((t for t in fit.terms if t.row == joint and t.effect.family == family), None)
            if present is None:
                continue
            if found := forms(problem, library, fit, present):
                fit = simplest(found, price).fit
            fit = _straightened(problem, library, fit, joint, family, price)
    return fit


def _straightened(problem: Problem, library: Library, fit: Fit, joint: int, family: str, price: Callable[[Term], float]) -> Fit:
    """The fit with a straight line against the speed, and the best form of dry friction, in place of a curve that is not
    clearly better: Stribeck's fall at low speed and a rise with the square of the speed bend the same way."""
    curved = next((t for t in fit.terms if t.row == joint and t.effect.simpler), None)
    if curved is None:
        return fit
    line = EFFECTS[curved.effect.simpler]
    others = [t for t in fit.terms if t is not curved and not (t.row == joint and t.kind is line)]
    trial = problem.fit([*others, library.local(line.id, joint)], fit.noise, inexact=fit.inexact)
    present = next((t for t in trial.terms if t.row == joint and t.effect.family == family), None)
    found = forms(problem, library, trial, present) if present is not None else []
    if not found:
        return fit
    best = simplest(found, price).fit
    paid = sum(map(price, best.terms)) - sum(map(price, fit.terms))
    return best if best.loglik - fit.loglik > paid - _CLEARLY else fit
