"""What can be seen of a term: one that is possible, and makes a part of the torque error that is worth a name."""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.term import Term

_SEEN = 0.012
"""Least part of the nominal residual (rms) that an effect must make on one of its joints."""
_SEEN_OF_ALL = 0.003
"""Least part of the nominal residual of all joints (rms, each over its noise), for effects that not every arm has."""
_FLOORS, _FLOORS_OF_NOISE = 0.4, 1.0
"""Least size (rms) of such an effect in noise floors, all joints together, and where its columns hold the noise themselves."""
_EDGE = 0.1
"""What changes within this part of the recordings from their start or end is no event: it may have been there always."""


def allowed(problem: Problem, fit: Fit, term: Term) -> bool:
    """True for a term that physics allows, and for an event that lies well inside of the recordings."""
    return term.possible(fit.theta_of(term), fit.std_of(term)) and _inside(problem, term)


def _inside(problem: Problem, term: Term) -> bool:
    if term.instant is None:
        return True
    within = [m.t for m in problem.band.motions if not term.recording or m.recording == term.recording]
    start, end = min(t[0] for t in within), max(t[-1] for t in within)
    return bool(_EDGE < (term.instant - start) / (end - start) < 1.0 - _EDGE)


def visible(problem: Problem, fit: Fit, term: Term) -> bool:
    """True where a term is a part of the nominal residual that is worth telling, over the noise of each joint."""
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
    floors = float(np.sum(power / noise[rows]))
    least = _FLOORS_OF_NOISE if term.effect.from_measured else _FLOORS
    return floors > max(least**2, _SEEN_OF_ALL**2 * float(np.sum(nominal[active] / noise[active])))
