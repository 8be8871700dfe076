"""When events happen in recordings that were not fitted: the one thing that is searched again there."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.refine import remake
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

OUTSIDE = 0.1
"""Time before the first and after the last instant of a recording, for an event that was before it, or after [s]."""
_UNSEEN = 0.3
"""Ends of a recording in which a change shows too little to be dated [s]."""
_GRID, _FINE = 41, 21
"""Times in a recording that are tried first, and about the best of them."""


def dated_again(library: Library, prepared: Prepared, fit: Fit, terms: Mapping[Term, Term]) -> dict[Term, Term]:
    """The events of a fit at the times at which these recordings leave the least.

    The first two events are searched as a pair: a body that is picked up and set down is neither alone. Residuals are weighted
    by the noise of each joint, all frequencies alike.

    Args:
        terms: of the fit, on these recordings.
    """
    events = [t for t in fit.terms if t.instant is not None]
    if not events:
        return {}
    # with the weights of coloured noise the cost has a narrow minimum, and tells nothing a quarter of a second beside it
    weight = 1.0 / np.sqrt(np.mean(fit.noise.variance(prepared.band.f), axis=0))
    active = prepared.problem.active
    rest = prepared.problem.y.copy()
    for term in fit.terms:
        if term not in events:
            x = terms[term].columns @ fit.theta_of(term)
            if term.row is None:
                rest -= x
            else:
                rest[:, term.row] -= x
    rest = (rest * weight)[:, active].ravel()

    def torque(term: Term, recording: str, t0: float) -> FloatArray:
        made = _at(library, term, recording, t0)
        x: FloatArray = ((made.columns @ fit.theta_of(term)) * weight)[:, active].ravel()
        return x

    names = library.recordings if len(library.recordings) > 1 else ("",)
    options = [(name, float(t)) for name in names for t in _times(library, name)]
    drawn = {e: np.stack([torque(e, *o) for o in options]) for e in events[:2]}
    dated: set[Term] = set()
    chosen = dict.fromkeys(events, options[-1])  # never
    chosen.update(zip(events, (options[i] for i in _best_pair(rest, list(drawn.values()))), strict=False))
    for event in [*events[2:], *events, *events]:
        left = rest - sum(torque(e, *chosen[e]) for e in events if e is not event)
        name, t0 = chosen[event]
        if event in events[2:] and t0 == options[-1][1]:
            name, t0 = min(options, key=lambda o: _power(left - torque(event, *o)))
        step = min(b - a for a, b in pairwise(_times(library, name)))
        step = step if event not in dated else 2.0 * step / (_FINE - 1)
        dated.add(event)
        near = t0 + np.linspace(-step, step, _FINE)
        chosen[event] = name, float(min(near, key=lambda t: _power(left - torque(event, name, float(t)))))
    out = {}
    for event in events:
        name, t0 = chosen[event]
        out[event] = _at(library, event, name, t0)
    return out


def in_words(library: Library, terms: Mapping[Term, Term]) -> tuple[str, ...]:
    """When the events of a fit are in recordings that were not fitted, in a sentence; none where there is none.

    Args:
        terms: of the fit, on these recordings.
    """
    dates = []
    for term in terms.values():
        if (t0 := term.instant) is not None:
            recording = term.recording
            start, end = library.times(recording)
            when = "before it begins" if t0 <= start + _UNSEEN else "never" if t0 >= end - _UNSEEN else f"at {t0:.2f} s"
            dates.append(f"{when} in {recording}" if recording else when)
    if not dates:
        return ()
    return (f"In the data that judge nothing is fitted; only when the payload changes is found anew there: {', '.join(dates)}.",)


def _at(library: Library, event: Term, recording: str, t0: float) -> Term:
    return remake(library, event, {**event.effect.settings, "recording": recording, event.effect.instant: t0})


def _times(library: Library, recording: str) -> FloatArray:
    start, end = library.times(recording)
    return np.linspace(start - OUTSIDE, end + OUTSIDE, _GRID)


def _power(x: FloatArray) -> float:
    return float(x @ x)


def _best_pair(rest: FloatArray, drawn: list[FloatArray]) -> tuple[int, ...]:
    """Option of each of one or two events that leaves the least of ``rest``, shape (R,).

    Args:
        drawn: what an event takes with each option, shape (options, R).
    """
    own = [-2.0 * x @ rest + np.sum(x**2, axis=1) for x in drawn]
    if len(drawn) == 1:
        return (int(np.argmin(own[0])),)
    both = own[0][:, None] + own[1] + 2.0 * drawn[0] @ drawn[1].T
    return tuple(int(i) for i in np.unravel_index(int(np.argmin(both)), both.shape))
