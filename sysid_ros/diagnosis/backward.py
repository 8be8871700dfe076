"""Backward checks: what is in a fit must still gain its price, be possible, be seen, and hold on rows not fitted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sysid_ros.diagnosis.cross_validation import predictive_gains
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS

_SEEN = 0.012
"""Least part of the nominal residual (rms) that an effect must make on one of its joints."""
_SEEN_OF_ALL = 0.003
"""Least part of the nominal residual of all joints (rms, each over its noise), for effects that not every arm has."""
_FLOORS, _FLOORS_OF_NOISE = 0.4, 1.0
"""Least size (rms) of such an effect in noise floors, all joints together, and where its columns hold the noise themselves."""
_EDGE = 0.1
"""What changes within this part of the recordings from their start or end is no event: it may have been there always."""
_ELSEWHERE = 3.0
"""Likelihood that a term must gain on segments that it was not fitted to."""
_SURELY = 20.0
"""A usual term whose significance is so many times its price need not be left out to see what it gains."""


def visible(problem: Problem, fit: Fit, term: Term) -> bool:
    """True where a term is a part of the nominal residual that one can see, over the noise of each joint."""
    active = [int(j) for j in problem.active]
    torque = term.columns @ fit.theta_of(term)
    share = torque if term.row is None else torque[:, None]
    rows = active if term.row is None else [term.row]
    power = np.sum(share[:, active if term.row is None else [0]] ** 2, axis=0)
    nominal = np.sum(problem.y**2, axis=0)
    noise = np.sum(fit.variance, axis=0)
    if not np.any(power > _SEEN**2 * nominal[rows]):
        return False
    if term.expected:
        return True
    if term.instant is not None:
        name = term.recording
        within = [m.t for m in problem.band.motions if not name or m.recording == name]
        start, end = min(t[0] for t in within), max(t[-1] for t in within)
        if not _EDGE < (term.instant - start) / (end - start) < 1.0 - _EDGE:
            return False
    floors = float(np.sum(power / noise[rows]))
    least = _FLOORS_OF_NOISE if term.effect.from_measured else _FLOORS
    return floors > max(least**2, _SEEN_OF_ALL**2 * float(np.sum(nominal[active] / noise[active])))


def prune(problem: Problem, fit: Fit, price: Callable[[Term], float]) -> Fit:
    """The fit without what no longer gains its price or is no longer possible, taken out one after the other."""
    while fit.terms:
        worst, margin, without = None, 0.0, fit
        elsewhere = predictive_gains(problem, fit)
        changed = {EFFECTS[t.effect.changes] for t in fit.terms if t.effect.changes}
        for term in fit.terms:
            theta, std = fit.theta_of(term), fit.std_of(term)
            significance = 0.5 * float(np.sum((theta / np.maximum(std, 1e-30)) ** 2))
            impossible = not term.possible(theta, std) or not visible(problem, fit, term)
            impossible = impossible or (elsewhere[term] < _ELSEWHERE and not (term.effect.partial or term.kind in changed))
            if significance > _SURELY * price(term) and term.expected and not impossible:
                continue
            rest = problem.fit([t for t in fit.terms if t is not term], fit.noise, inexact=fit.inexact)
            left = fit.loglik - rest.loglik - price(term) - (1e9 if impossible else 0.0)
            if left < margin:
                worst, margin, without = term, left, rest
        if worst is None:
            break
        fit = without
    return fit


def without_nuisance(problem: Problem, fit: Fit) -> Fit:
    """The fit with the links' masses exactly as the URDF says, where the rows are more likely so."""
    exact = problem.fit(list(fit.terms), fit.noise)
    return exact if exact.loglik > fit.loglik else fit
