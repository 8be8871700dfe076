"""When an event was, by the likelihood of the rows at other times: in a rest it may have been at any time, and a slope tells of
none."""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

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
        away, farthest, inside = _FIRST, max(side * (end - found), 0.0), True
        while inside:
            t0 = found + side * min(away, farthest)
            logs[t0] = likelihood(t0)
            inside, away = away < farthest and logs[t0] > lowest, 2.0 * away
    for t0 in np.linspace(min(logs), max(logs), _TIMES):
        logs[float(t0)] = likelihood(float(t0))
    times = np.array(sorted(logs))
    values = np.array([logs[t0] for t0 in times.tolist()])
    density = np.exp(values - values.max())
    moments = [_integral(times, density, (times - found) ** k, (_middles(times) - found) ** k) for k in range(3)]
    mean = moments[1] / moments[0]
    return found + mean, float(np.sqrt(moments[2] / moments[0] - mean**2))


def _middles(x: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (x[1:] + x[:-1]))


def _integral(times: FloatArray, density: FloatArray, at: FloatArray, between: FloatArray) -> float:
    """Of a density that is straight from time to time, times a function of these and their middles (Simpson's rule)."""
    ends = density * at
    return float(np.sum(np.diff(times) * (ends[1:] + 4.0 * _middles(density) * between + ends[:-1])) / 6.0)
