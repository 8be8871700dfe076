"""How a compliant joint follows its compliance and what its links weigh: what rings shows the stiffness over the inertia."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

_PROBE = 0.003
"""Relative step of a difference."""
_DIRECTIONS, _PART = 6, 0.05
"""Ways in which inexact links load a compliant joint, those that load it most, and how far they are followed of what is usual."""
_LINEAR = 0.5
"""Part of what a step gains that the torques may cost which are not on its tangent: from there on the step leads nowhere."""


class Swing(NamedTuple):
    """A compliant joint with inexact links on it: the derivative of its torque by the compliance, shape (K, n), and by each
    parameter of the links, shape (K, n, c)."""

    term: Term
    slope: FloatArray
    by_links: FloatArray


def swinging(problem: Problem, library: Library, fit: Fit) -> tuple[Swing, ...]:
    """The compliant joints of a fit whose links are inexact."""
    terms = [t for t in fit.terms if fit.inexact and (how := t.effect.deflection) and how.smooth]
    return tuple(Swing(t, slope_of(library, t), by_links(problem, library, fit, t)) for t in terms)


def has_slope(term: Term) -> bool:
    """True where a term's torque is far from its columns times its parameter, and :func:`slope_of` tells its slope."""
    curved = term.effect.deflection is not None or (term.effect.low_passes and term.effect.settings["around"] > 0.0)
    return term.effect.corrects or curved


def slope_of(library: Library, term: Term) -> FloatArray:
    """Derivative of a compliant joint's torque by its compliance or gap, and of all torques by a delay or a lag, shape (K, n):
    far from the torque over any of these."""
    if term.effect.corrects:
        return np.asarray(library.remake(term, around=0.0).columns[..., 0])
    value = float(term.effect.settings["around"])
    sides = [value * (1.0 + s) for s in (_PROBE, -_PROBE)]
    torque = [library.remake(term, around=x).columns[..., 0] * x for x in sides]
    return np.asarray((torque[0] - torque[1]) / (2.0 * _PROBE * value))


def by_links(problem: Problem, library: Library, fit: Fit, term: Term) -> FloatArray:
    """Along the directions in which the links, as far off as is usual, load that joint most, shape (K, n, c)."""
    joint, usual, around = term.joints[0], problem.prior**-0.5, float(term.effect.settings["around"])
    columns = problem.nuisance[:, joint] * usual / np.sqrt(fit.variance[:, joint, None])
    directions = np.linalg.svd(columns, full_matrices=False)[2][:_DIRECTIONS]
    out = np.zeros_like(problem.nuisance)
    for direction in directions:
        other = library.remake(term, links=_links(fit, term, _PART * usual * direction))
        out += (other.columns - term.columns) * around / _PART * (direction / usual)
    return out


def follows(library: Library, fit: Fit, swings: Sequence[Swing], moved: FloatArray, gained: float) -> bool:
    """True where the torques of compliant joints follow a step of all parameters, shape (p,), so near to their tangents that it
    gains what it says. A link that swings near its resonance soon swings otherwise than any tangent says."""
    off = np.zeros_like(fit.residual)
    for term, slope, by_links in swings:
        around, step = float(term.effect.settings["around"]), float(moved[fit.slices[fit.terms.index(term)].start])
        change = moved[len(moved) - by_links.shape[2] :]
        if around + step <= 0.0:
            return False
        other = library.remake(term, around=around + step, links=_links(fit, term, change))
        torque = other.columns[..., 0] * (around + step) - term.columns[..., 0] * around
        off += torque - slope * step - by_links @ change
    joints = list(fit.blocks)
    cost = 0.5 * float(np.sum(off[:, joints] ** 2 / fit.variance[:, joints]))
    return bool(np.isfinite(cost)) and cost <= _LINEAR * gained


def _links(fit: Fit, term: Term, change: FloatArray) -> list[float]:
    """The links that a term's columns were made for, changed by some parameters of theirs, shape (10 n,)."""
    own = np.array(term.effect.settings.get("links") or np.zeros(len(fit.links)))
    changed: list[float] = (own + fit.links @ change).tolist()
    return changed
