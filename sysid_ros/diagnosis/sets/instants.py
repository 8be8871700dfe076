"""When an event was, by the likelihood of the rows at other times: in a rest it may have been at any time, and a slope tells of
none."""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term

_FIRST, _OUT = 0.001, 12.0
"""First step away from the time that was found [s], each twice the one before; log-likelihood that ends the look."""
_TIMES = 24
"""Times that are spread evenly over those, beside them."""


def instant_of(problem: Problem, library: Library, fit: Fit, term: Term, scatter: float) -> tuple[float, float]:
    """Mean and standard deviation of the time of an event [s], with the sizes of all that is in the fit free.

    Args:
        scatter: how much more the rows scatter over time than the noise explains, variance over variance.
    """
    found, others = float(term.effect.settings[term.effect.instant]), [t for t in fit.terms if t is not term]

    def likelihood(t0: float) -> float:
        moved = library.remake(term, **{term.effect.instant: t0})
        return problem.fit([*others, moved], fit.noise, 0, fit.inexact).loglik / scatter

    logs = {found: likelihood(found)}
    lowest = logs[found] - _OUT
    for side, end in zip((-1.0, 1.0), library.times(term.recording), strict=True):
        away, farthest, inside = _FIRST, side * (end - found), True
        while inside and away < farthest:
            t0 = found + side * away
            logs[t0] = likelihood(t0)
            inside, away = logs[t0] > lowest, 2.0 * away
    for t0 in np.linspace(min(logs), max(logs), _TIMES):
        logs[float(t0)] = likelihood(float(t0))
    times = np.array(sorted(logs))
    values = np.array([logs[t0] for t0 in times.tolist()])
    density = np.exp(values - values.max())
    density /= np.trapezoid(density, times)
    mean = float(np.trapezoid(density * times, times))
    return mean, float(np.sqrt(np.trapezoid(density * (times - mean) ** 2, times)))
