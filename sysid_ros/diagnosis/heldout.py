"""Recordings that were not fitted: what a fit predicts of them, when events happen there, and the plain baseline's error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sysid_ros.diagnosis.corrections import correct, lean
from sysid_ros.diagnosis.fit import Fit, Problem, allowed
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import SCALES, Prepared, torques
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import SHORTEST
from sysid_ros.signals.recording import Recording

OUTSIDE = 0.1
"""Time before the first and after the last instant of a recording, for an event that was before it, or after [s]."""
_UNSEEN = 0.3
"""Ends of a recording in which a change shows too little to be dated [s]."""
_GRID, _FINE = 41, 21
"""Times in a recording that are tried first, and about the best of them."""
_PART = SHORTEST + 0.1
"""Shortest part of a recording that is worth judging on, and enough rows for its stretch [s]."""
_HELD_OUT = 0.3
"""Part of the recordings that is held out where no others are given to judge on."""
_USUAL = 0.5
"""Effects that so many joints have, but for those of inertia, are what every model of a joint has."""
_WORSE = 1.05
"""Held-out error, over that of the baseline, from which a joint is worse."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Held-out rows and the terms of a fit on them.

    Attributes:
        prepared: the recordings. terms: a fitted term to the same term on these recordings.
    """

    prepared: Prepared
    library: Library
    terms: dict[Term, Term]

    @classmethod
    def of(cls, robot: RobotModel, prepared: Prepared, fit: Fit) -> HeldOut:
        """The terms of ``fit`` on held-out recordings; only the time of an event is searched again."""
        library = Library(robot, prepared.band, inside=-OUTSIDE)
        held = cls(prepared, library, {})
        held.update(fit)
        held.terms.update(dated_again(library, prepared, fit, held.terms))
        return held

    def update(self, fit: Fit) -> None:
        """Make the terms of a fit known, with the torques that it makes here."""
        links = [m.link_torque for m in self.prepared.motions]
        for _ in range(2 if any(t.on_torques for t in fit.terms) else 0):
            self.library.update(*torques(self.library, fit, links, self.prepared.nominal))
        lean(self.library, fit)
        for term in fit.terms:
            if term not in self.terms or self.library.follows(term):
                self.terms[term] = self.library.remake(term)
        correct(self.prepared.problem, self.library, [self.terms[t] for t in fit.terms])

    def add(self, terms: Sequence[Term]) -> None:
        """Make terms known that are not in the fit."""
        for term in terms:
            if term not in self.terms:
                self.terms[term] = self.library.remake(term)

    def residual(self, fit: Fit) -> FloatArray:
        """Rows that a fit leaves, shape (K, n)."""
        out = self.prepared.problem.y.copy()
        for term in fit.terms:
            out -= self.terms[term].rows(fit.theta_of(term))
        if fit.inexact:
            out -= self.prepared.problem.nuisance @ fit.theta[-self.prepared.problem.nuisance.shape[2] :]
        return out

    def rms(self, rows: FloatArray) -> FloatArray:
        """Root mean square over time of what rows stand for, a joint, shape (n,) [N m]."""
        samples = sum(len(m.t) for m in self.prepared.motions)
        rms: FloatArray = np.sqrt(np.sum(rows**2, axis=0) / samples)
        return rms

    def predictions(self, fit: Fit) -> list[FloatArray]:
        """Torque of the extended model on the grids of the motions, shape (N, n) each [N m]."""
        out = [x.copy() for x in self.prepared.nominal]
        for term in fit.terms:
            theta = term.theta_of_effect(fit.theta_of(term))
            for i in range(len(out)):
                out[i] += self.library.along(self.terms[term], theta, i)
        if fit.inexact:
            for i in range(len(out)):
                out[i] += self.library.links_along(fit.links_off, i)
        return out


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
    weight = 1.0 / np.sqrt(np.mean(fit.noise.along(prepared.band), axis=0))
    active = prepared.problem.active
    rest = prepared.problem.y.copy()
    for term in fit.terms:
        if term not in events:
            rest -= terms[term].rows(fit.theta_of(term))
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


def dates_in_words(library: Library, terms: Mapping[Term, Term]) -> tuple[str, ...]:
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
    return library.remake(event, recording=recording, **{event.effect.instant: t0})


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


def plain_terms(library: Library, joint: int) -> list[Term]:
    """Offset, Coulomb and viscous friction of a joint."""
    kinds = [EFFECTS[name] for name in library.of_joints]
    return [library.local(kind.id, joint) for kind in kinds if kind.usual >= _USUAL and not kind.inertial]


def no_worse(problem: Problem, library: Library, fit: Fit, held: HeldOut) -> Fit:
    """The fit where it predicts no joint of the held-out recordings worse than the baseline does, else one that does not.

    A joint that is worse gets the baseline's terms in place of its own, or none, or the links are more or less inexact, or exact:
    of those with which it is no worse what leaves the least of all joints, else what leaves the least of it. None makes another
    joint worse than the baseline, and nothing that physics forbids takes a place, if it predicts ever so well. All of it gives
    way where it predicts worse in all even then. The problem's scale becomes the fit's.
    """
    plain = {int(j): plain_terms(library, int(j)) for j in problem.active}
    held.add([t for terms in plain.values() for t in terms])
    there = held.prepared.band
    floor = np.maximum(held.rms(np.sqrt(fit.noise.along(there) * there.counted)), 1e-9)
    active = there.active & problem.band.active

    def error(x: Fit) -> FloatArray:
        return np.where(active, held.rms(held.residual(x)) / floor, 0.0)

    def of_all(x: Fit) -> float:
        return float(np.sum(error(x) ** 2))

    def made(terms: Sequence[Term], scale: tuple[float, float]) -> Fit:
        problem.scale = scale
        return problem.fit(terms, fit.noise, 0, scale != exact)

    def lawful(terms: Sequence[Term], scale: tuple[float, float]) -> Fit:
        while True:
            found = made(terms, scale)
            wrong = next((t for t in terms if t not in fit.terms and not allowed(problem, found, t)), None)
            if wrong is None:
                return found
            terms = [t for t in terms if t is not wrong]

    exact, usual = SCALES[0], problem.scale
    scale = usual if fit.inexact else exact
    every = [t for terms in plain.values() for t in terms]
    baseline = made(every, exact)
    simpler = min((lawful(every, exact), made([], exact)), key=of_all)
    problem.scale = usual
    limit = _WORSE * error(baseline)
    for j in np.argsort(-error(fit) / np.maximum(limit, 1e-9)):
        if error(fit)[j] <= limit[j] or int(j) not in plain:
            continue
        others = [t for t in fit.terms if t.row != j]
        options = [(lawful(terms, scale), scale) for terms in ([*others, *plain[int(j)]], others)]
        options += [(made(fit.terms, x), x) for x in SCALES if x != scale]
        most = np.maximum(error(fit), limit)
        options = [x for x in options if np.all(error(x[0]) <= most) and error(x[0])[j] < error(fit)[j]]
        good = [x for x in options if error(x[0])[j] <= limit[j]]
        fit, scale = (
            min(good, key=lambda x: of_all(x[0]))
            if good
            else min(options, key=lambda x: float(error(x[0])[j]), default=(fit, scale))
        )
        problem.scale = usual if scale == exact else scale
    if np.linalg.norm(error(fit)) > _WORSE * np.linalg.norm(error(simpler)):
        problem.scale = exact
        return simpler
    return fit


def split(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """What to fit on and what to judge on: the first and the last part of each recording, and of those that are too short for two
    parts the first and the last ones as a whole."""
    long = [r for r in recordings if r.seconds >= 2.0 * _PART or len(recordings) == 1]
    short = [r for r in recordings if not any(r is x for x in long)]
    times = np.cumsum([0.0, *(r.seconds for r in short)])
    fitted = min(int(np.searchsorted(times, (1.0 - _HELD_OUT) * times[-1])), max(len(short) - 1, 1))
    first, last = short[:fitted], short[fitted:]
    for r in long:
        judged = max(_HELD_OUT * r.seconds, min(_PART, 0.5 * r.seconds))
        cut = int(np.searchsorted(r.t, r.t[-1] - judged))
        first.append(r.at(slice(None, cut), f"{r.name} (first part)"))
        last.append(r.at(slice(cut, None), f"{r.name} (held-out part)"))
    return first, last
