"""The forms of dry friction that a joint may have, each at its best."""

from __future__ import annotations

from dataclasses import dataclass

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.refine import refine
from sysid_ros.diagnosis.scoring import Scorer
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, forms_of

_STANDS_IN = 5.0
"""Likelihood by which time must be better than a measured temperature, for which it only stands in."""

_TRIED = 4.0
"""Likelihood that a richer form must gain beside the present one before it is tried in its place."""


@dataclass(frozen=True, eq=False)
class Form:
    """A form of friction on a joint, and the fit with it."""

    term: Term
    fit: Fit


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
                trials.append(Form(term, trial))
        if trials:
            found.append(max(trials, key=lambda f: f.fit.loglik + (_STANDS_IN if f.term.effect.follows_temperature else 0.0)))
    return found
