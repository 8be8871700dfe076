"""Nonlinear knobs, moved from the values that were tried first to where the rows are the most likely; and columns that depend on
torques, on what the links weigh or on how late the efforts are, made anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy import optimize

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.corrections import correct, lean
from sysid_ros.diagnosis.covariance import KnobOfTerm, knobs_of
from sysid_ros.diagnosis.deflections import fit_deflection
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import links_changed, torques
from sysid_ros.diagnosis.swings import slope_of
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import Depends, Knob
from sysid_ros.estimators.symmetric import inverse_of
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.whittle import Noise

_NARROWED_STEPS = 8
_FIXED_POINTS = 3
_SCAN = 13
_NEAR, _APART = 8, 0.015
"""Number and spacing of the times on each side of an event that are tried at last, and then as many within one spacing [s]."""
_ADVANCED = 3
"""Steps to the delay by which measured torques are advanced."""
_NEWTON, _GAINED, _FARTHEST = 6, 0.5, 0.4
"""Most steps of all knobs together, log-likelihood that another one must bring, and how far one goes at most (of a logarithm)."""
_PARTS = (1.0, 0.5, 0.2)
"""Parts of such a step that are tried."""
_HEAVIER = 0.01
"""Part of the mass of all links by which they must change before a compliance is looked for again: a search, no evidence."""


def refine(problem: Problem, library: Library, fit: Fit, terms: Sequence[Term]) -> Fit:
    """The fit with the knobs of ``terms`` moved to where the rows are the most likely, one knob after the other."""
    changed: dict[Term, Term] = {}
    for term in terms:
        if term.effect.corrects:
            continue
        if "around" in term.effect.settings:
            step = fit_deflection if term.effect.deflection else _exact
            fit, changed[term] = step(problem, library, fit, term)
            continue
        if all(knob.name not in term.effect.settings for knob in term.effect.knobs):
            continue
        changed[term] = _local(problem, library, fit, term) if term.row is not None else _whole(problem, library, fit, term)
    if not any(new is not old for old, new in changed.items()):
        return fit
    return problem.fit([changed.get(t, t) for t in fit.terms], fit.noise, inexact=fit.inexact)


def _exact(problem: Problem, library: Library, fit: Fit, term: Term) -> tuple[Fit, Term]:
    """Columns that are exact at the parameters found, by a few fixed-point steps."""
    for _ in range(_FIXED_POINTS):
        theta = fit.theta_of(term)
        around = float(theta[0]) if len(theta) == 1 else [float(x) for x in theta]
        new = library.remake(term, around=around)
        fit = problem.fit([new if t is term else t for t in fit.terms], fit.noise, 2, fit.inexact)
        term = new
    return fit, term


def _local(problem: Problem, library: Library, fit: Fit, term: Term) -> Term:
    """One joint's knobs, with what the joint's other terms explain adjusted and the rest as it is."""
    j = term.row
    assert j is not None
    root = 1.0 / np.sqrt(fit.variance[:, j])
    mates = [t for t in fit.terms if t.row == j and t is not term]
    fixed = np.concatenate([np.zeros((len(root), 0)), *(t.columns for t in mates)], axis=1)
    target = fit.residual[:, j] + term.columns @ fit.theta_of(term) + sum((t.columns @ fit.theta_of(t) for t in mates), 0.0)

    basis = np.linalg.qr(fixed * root[:, None])[0]
    z = target * root
    z -= basis @ (basis.T @ z)

    def cost(settings: dict[str, Any]) -> float:
        X = library.column(term.id, j, settings) * root[:, None]
        X -= basis @ (basis.T @ X)
        theta = np.linalg.lstsq(X, z, rcond=1e-9)[0]
        return float(np.sum((z - X @ theta) ** 2))

    settings = search(term, dict(term.effect.settings), cost)
    return library.local(term.id, j, **settings) if settings != term.effect.settings else term


def _whole(problem: Problem, library: Library, fit: Fit, term: Term) -> Term:
    """The knobs of a term of the whole arm.

    An event is found by least squares first: a likelihood whose noise is free is at its highest within a tenth of a second of it,
    and elsewhere takes a change at a wrong time for noise.
    """
    others = [t for t in fit.terms if t is not term]

    def tried(settings: dict[str, Any], noise: RowNoise, turns: int) -> float:
        return -problem.fit([*others, library.remake(term, **settings)], noise, turns, fit.inexact).loglik

    def cost(settings: dict[str, Any]) -> float:
        return tried(settings, fit.noise, 2)

    settings = dict(term.effect.settings)
    if instant := term.effect.instant:
        even = Noise.even(np.mean(fit.residual**2, axis=0))
        settings = search(term, settings, lambda s: tried(s, even, 0))
        for apart in (_APART, _APART / _NEAR):
            near = settings[instant] + np.arange(-_NEAR, _NEAR + 1) * apart
            settings = min(({**settings, instant: float(t0)} for t0 in near), key=cost)
        if cost(settings) > cost(dict(term.effect.settings)):
            settings = dict(term.effect.settings)
    else:
        settings = search(term, settings, cost)
    return library.remake(term, **settings) if settings != term.effect.settings else term


def search(term: Term, settings: dict[str, Any], cost: Callable[[dict[str, Any]], float]) -> dict[str, Any]:
    """Settings of the least cost, of each knob in turn, by Brent's method within bounds."""
    best = cost(settings)
    for knob in term.effect.knobs:
        if knob.name not in settings:
            continue
        low, high = term.effect.search_range(knob, float(settings[knob.name]), term.load)
        a, b = (np.log(low), np.log(high)) if knob.logarithmic else (low, high)

        def moved(x: float, knob: Knob = knob, settings: dict[str, Any] = settings) -> dict[str, Any]:
            return {**settings, knob.name: float(np.exp(x) if knob.logarithmic else x)}

        if knob.bumpy:
            grid = np.linspace(a, b, _SCAN)
            x = grid[int(np.argmin([cost(moved(float(g))) for g in grid]))]
            a, b = x - (grid[1] - grid[0]), x + (grid[1] - grid[0])
        steps = {"maxiter": _NARROWED_STEPS}
        found = optimize.minimize_scalar(lambda x: cost(moved(float(x))), bounds=(a, b), method="bounded", options=steps)
        if found.fun < best:
            best, settings = float(found.fun), moved(float(found.x))
    return settings


def made_anew(
    problem: Problem,
    library: Library,
    fit: Fit,
    links: Sequence[FloatArray],
    nominal: Sequence[FloatArray],
    refined: bool = True,
) -> Fit:
    """The fit on a library that knows its torques.

    Args:
        links, nominal: torque of the nominal links and of the nominal model on the library's motions, shape (N, n) each.
        refined: move the knobs of what is made anew; else they stay, and the rows are no likelier than with their best.
    """
    carried = links_changed(fit)
    lean(library, fit)
    again = {t: dict(t.effect.settings) for t in fit.terms if library.follows(t)}
    for t in fit.terms:
        before = t.effect.settings.get("links")
        if Depends.LINKS in t.effect.depends_on and (carried.any() or before):
            again[t] = {**t.effect.settings, "links": carried.tolist() if carried.any() else []}
            if refined and t.effect.deflection and _heavier(library.robot, carried, before or ()):
                again[t]["exact"] = False  # another spring makes these links swing as they were seen to
    made = {t: library.remake(t, **settings) for t, settings in again.items()}
    # on the way to a set links may be lighter than nothing: they swing on no spring, which stays as it was made
    made = {t: new for t, new in made.items() if np.isfinite(new.columns).all()}
    if made or problem.corrected:
        fit = _with(problem, library, fit, [made.get(t, t) for t in fit.terms])
        fit = refine(problem, library, fit, list(made.values())) if refined else fit
    for _ in range(_ADVANCED if refined and any(t.effect.corrects for t in fit.terms) else 0):
        library.update(*torques(library, fit, links, nominal))
        for term in [t for t in fit.terms if t.effect.corrects]:
            fit = _advanced(problem, library, fit, term)
    return fit


def sharpened(problem: Problem, library: Library, fit: Fit, links: Sequence[FloatArray], nominal: Sequence[FloatArray]) -> Fit:
    """The fit with all knobs, and the delay of the efforts, where the rows are the most likely together: steps of Gauss and
    Newton. One after the other they follow each other slowly, as friction that builds up late and a delay do.

    Args:
        links, nominal: as :func:`made_anew` has them.
    """

    def anew(fit: Fit) -> Fit:
        library.update(*torques(library, fit, links, nominal))
        return made_anew(problem, library, fit, links, nominal, refined=False)

    fit = anew(fit)
    for _ in range(_NEWTON):
        moved = _all_moved(problem, library, fit)
        if moved is None:
            break
        better = anew(moved)
        if better.loglik < fit.loglik:
            return anew(fit)
        fit, gained = better, better.loglik - fit.loglik
        if gained < _GAINED:
            break
    return fit


def _all_moved(problem: Problem, library: Library, fit: Fit) -> Fit | None:
    """The fit after one step; None where no part of it makes the rows likelier."""
    knobs = [x for x in knobs_of(library, fit) if x.term.instant is None and not x.term.effect.deflection]
    delays = {t: slope_of(library, t) for t in fit.terms if t.effect.corrects}
    if not knobs and not delays:
        return None
    count, residual = len(fit.theta), fit.residual.copy()
    for term in delays:  # from the delay that the columns are exact at
        residual += term.rows(fit.theta_of(term) - float(term.effect.settings["around"]))
    known = [*(t.prior for t in fit.terms), problem.prior if fit.inexact else np.zeros(0)]
    information = np.diag(np.concatenate([*known, [12.0 / x.reach**2 for x in knobs]]))
    score = -np.diag(information) * np.concatenate([fit.theta, np.zeros(len(knobs))])
    for j, (index, X) in fit.blocks.items():
        columns = np.concatenate([X, *(x.slope[:, j, None] for x in knobs)], axis=1)
        for term, slope in delays.items():
            columns[:, np.flatnonzero(index == fit.slices[fit.terms.index(term)].start)] = slope[:, j, None]
        every = np.concatenate([index, np.arange(count, len(score))])
        information[np.ix_(every, every)] += columns.T @ (columns / fit.variance[:, j, None])
        score[every] += columns.T @ (residual[:, j] / fit.variance[:, j])
    step = inverse_of(information) @ score
    late = {t: float(step[fit.slices[fit.terms.index(t)].start]) for t in delays}
    for part in _PARTS:
        settings: dict[Term, dict[str, float]] = {
            t: {"around": float(t.effect.settings["around"]) + part * late[t]} for t in late
        }
        for x, by in zip(knobs, step[count:], strict=True):
            settings.setdefault(x.term, {})[x.knob.name] = _stepped(x, part * float(by))
        made = {t: library.remake(t, **own) for t, own in settings.items()}
        moved = _with(problem, library, fit, [made.get(t, t) for t in fit.terms])
        if moved.loglik > fit.loglik:
            return moved
    correct(problem, library, fit.terms)
    return None


def _stepped(x: KnobOfTerm, by: float) -> float:
    """Value of a knob after a step, in the range in which it is searched."""
    low, high = x.term.effect.search_range(x.knob, x.value, x.term.load)
    to = x.value * float(np.exp(np.clip(by / x.value, -_FARTHEST, _FARTHEST))) if x.knob.logarithmic else x.value + by
    return float(np.clip(to, low, high))


def _with(problem: Problem, library: Library, fit: Fit, terms: Sequence[Term]) -> Fit:
    """The fit with other terms in place of its own, and with what they change of the measured rows."""
    correct(problem, library, terms)
    return problem.fit(terms, fit.noise, inexact=fit.inexact)


def _advanced(problem: Problem, library: Library, fit: Fit, term: Term) -> Fit:
    """A step of Newton's to the delay: what is left with the torques advanced, along the tangent of the model's torque."""
    around = float(term.effect.settings["around"])
    tangent, others = library.remake(term, around=0.0), [t for t in fit.terms if t is not term]
    correct(problem, library, fit.terms)
    problem.y = problem.y - term.rows(np.array([around]))
    step = problem.fit([*others, tangent], fit.noise, inexact=fit.inexact).theta_of(tangent)
    new = library.remake(term, around=around + float(step[0]))
    return _with(problem, library, fit, [new if t is term else t for t in fit.terms])


def _heavier(robot: RobotModel, links: FloatArray, before: Sequence[float]) -> bool:
    """True where links that differ from the URDF's by so much, shape (10 n,) each, are not those of before."""
    change = links - np.asarray(before) if len(before) else links
    return bool(np.sum(np.abs(change[::10])) > _HEAVIER * np.sum(robot.pi[::10]))
