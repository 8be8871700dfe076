"""What does not pay on held-out recordings is not claimed."""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.backward import EXPECTED
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import DRY

_CLEAR, _DOUBT = 25.0, 0.2
"""What an effect that every arm has gains on the fitted rows beyond this likelihood may be lost elsewhere by this part: a model
that is not quite exact loses on other motion what a short recording can't tell."""


def paying(problem: Problem, library: Library, fit: Fit, held: HeldOut) -> Fit:
    """The fit without the terms that make held-out rows less likely, the worst first; the others are fitted anew.

    A richer form of dry friction is asked against the simplest one. Nothing is fitted to the held-out rows.
    """
    while fit.terms:
        worst, least, without = None, 0.0, fit
        cost = whitened_cost(fit, held, fit)
        for term in fit.terms:
            others = [t for t in fit.terms if t is not term]
            if term.id in DRY[1:]:
                others.append(library.local(DRY[0], term.joints[0]))
            rest = problem.fit(others, fit.noise, inexact=fit.inexact)
            held.add(others)
            gain = whitened_cost(rest, held, fit) - cost
            if term.id in EXPECTED:
                gain += _DOUBT * max(fit.loglik - rest.loglik - _CLEAR, 0.0)
            if gain < least:
                worst, least, without = term, gain, rest
        if worst is None:
            break
        fit = without
    return fit


def whitened_cost(fit: Fit, held: HeldOut, judge: Fit) -> float:
    """Half the whitened sum of squares that a fit leaves of the held-out rows, with the noise of ``judge``."""
    active = held.prepared.problem.active
    noise = judge.noise.variance(held.prepared.band.f)
    return 0.5 * float(np.sum((held.residual(fit) ** 2 / noise)[:, active]))
