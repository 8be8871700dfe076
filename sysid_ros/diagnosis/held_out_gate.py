"""What does not make held-out recordings likelier is not claimed."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term

_CLEAR, _DOUBT = 25.0, 0.2
"""What an effect that every arm has gains on the fitted rows beyond this likelihood may be lost elsewhere by this part: a model
that is not quite exact loses on other motion what a short recording can't tell."""
_MOST_PAIRS = 60
"""More pairs than this are not asked."""


def validated(problem: Problem, library: Library, fit: Fit, held: HeldOut) -> Fit:
    """The fit without the terms that make held-out rows less likely, the worst first; the others are fitted anew.

    A richer form of dry friction is asked against the simplest one. Terms that make up for one another, of which none can go
    alone, are asked as a group too. Nothing is fitted to the held-out rows.
    """
    while fit.terms:
        cost = whitened_cost(fit, held, fit)
        without = _asked(problem, library, fit, held, cost, [[t] for t in fit.terms])
        if without is None:
            without = _asked(problem, library, fit, held, cost, _pairs_and_groups(fit))
        if without is None:
            break
        fit = without
    return _better_than_nothing(problem, fit, held)


def _better_than_nothing(problem: Problem, fit: Fit, held: HeldOut) -> Fit:
    """The fit, or what every arm has of it, or nothing: whatever leaves the least torque error, each joint's over its noise.

    The likelihood makes little of errors at frequencies at which the noise is large, and what slow noise is was learned from what
    no effect explained. A model that predicts worse than none explains nothing.
    """
    floor = held.rms(np.sqrt(fit.noise.variance(held.prepared.band.f)))
    weight = np.where(held.prepared.band.active, 1.0 / np.maximum(floor, 1e-9), 0.0)

    def error(x: Fit) -> float:
        return float(np.sum((held.rms(held.residual(x)) * weight) ** 2))

    nothing = problem.fit([], fit.noise, inexact=fit.inexact)
    if not fit.terms or error(fit) <= error(nothing):
        return fit
    usual = problem.fit([t for t in fit.terms if t.expected], fit.noise, inexact=fit.inexact)
    return min((nothing, usual), key=error)


def _pairs_and_groups(fit: Fit) -> list[list[Term]]:
    """Pairs of terms that load a joint in common, all that load one, and all; but for what every arm has, which goes alone."""
    terms = [t for t in fit.terms if not t.expected]
    loads = {t: set(range(t.effect.robot.n)) if t.row is None else {t.row} for t in terms}
    pairs = [[a, b] for a, b in combinations(terms, 2) if loads[a] & loads[b]]
    local = [[t for t in terms if t.row == j] for j in sorted({t.row for t in terms if t.row is not None})]
    return [x for x in [*(pairs if len(pairs) <= _MOST_PAIRS else []), *local, terms] if len(x) > 1]


def _asked(problem: Problem, library: Library, fit: Fit, held: HeldOut, cost: float, groups: list[list[Term]]) -> Fit | None:
    """The fit without the group of terms without which the held-out rows are the likeliest, where they are likelier so."""
    least, without = 0.0, None
    for group in groups:
        others = [t for t in fit.terms if t not in group]
        others += [library.local(t.simplest.id, t.joints[0]) for t in group if t.simplest and len(group) == 1]
        rest = problem.fit(others, fit.noise, inexact=fit.inexact)
        held.add(others)
        gain = whitened_cost(rest, held, fit) - cost
        if group[0].expected:
            gain += _DOUBT * max(fit.loglik - rest.loglik - _CLEAR, 0.0)
        if gain < least:
            least, without = gain, rest
    return without


def whitened_cost(fit: Fit, held: HeldOut, judge: Fit) -> float:
    """Half the whitened sum of squares that a fit leaves of the held-out rows, with the noise of ``judge``."""
    active = held.prepared.problem.active
    noise = judge.noise.variance(held.prepared.band.f)
    return 0.5 * float(np.sum((held.residual(fit) ** 2 / noise)[:, active]))
