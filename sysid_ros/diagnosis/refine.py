"""Refinement of nonlinear knobs around the values that were tried first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy import optimize

from sysid_ros.diagnosis.compliant import fit_deflection
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.diagnosis.torque_noise import Noise
from sysid_ros.effects import Knob

_STEPS = 8
_FIXED_POINTS = 3
_SCAN = 13
_NEAR, _APART = 8, 0.015
"""Number and spacing of the times on each side of an event that are tried at last [s]."""


def refine(problem: Problem, library: Library, fit: Fit, terms: Sequence[Term]) -> Fit:
    """The fit with the knobs of ``terms`` moved to where the rows are the most likely, one knob after the other."""
    changed: dict[Term, Term] = {}
    for term in terms:
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
        new = remake(library, term, {**term.effect.settings, "around": around})
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

    def tried(settings: dict[str, Any], noise: Noise, turns: int) -> float:
        return -problem.fit([*others, remake(library, term, settings)], noise, turns, fit.inexact).loglik

    def cost(settings: dict[str, Any]) -> float:
        return tried(settings, fit.noise, 2)

    settings = dict(term.effect.settings)
    if instant := term.effect.instant:
        even = Noise.even(np.mean(fit.residual**2, axis=0))
        settings = search(term, settings, lambda s: tried(s, even, 0))
        near = settings[instant] + np.arange(-_NEAR, _NEAR + 1) * _APART
        settings = min(({**settings, instant: float(t0)} for t0 in near), key=cost)
        if cost(settings) > cost(dict(term.effect.settings)):
            settings = dict(term.effect.settings)
    else:
        settings = search(term, settings, cost)
    return remake(library, term, settings) if settings != term.effect.settings else term


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
        steps = {"maxiter": _STEPS}
        found = optimize.minimize_scalar(lambda x: cost(moved(float(x))), bounds=(a, b), method="bounded", options=steps)
        if found.fun < best:
            best, settings = float(found.fun), moved(float(found.x))
    return settings


def remake(library: Library, term: Term, settings: dict[str, Any]) -> Term:
    """The same term with other settings."""
    if term.row is not None:
        return library.local(term.id, term.row, **settings)
    joints = term.joints if len(term.joints) < library.robot.n else ()
    return library.whole(term.id, joints, term.basis, term.form, **settings)
