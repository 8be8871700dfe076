"""Covariance of all parameters of a fit, the nonlinear ones included."""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.refine import remake
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray


def with_knobs(problem: Problem, library: Library, fit: Fit) -> dict[Term, tuple[FloatArray, FloatArray]]:
    """Values and covariance of each term: theta of its columns, then its knobs (Gauss-Newton about the fit).

    The weights are those of the coloured noise, so slow errors count for the few independent values that they are.
    """
    extra, owners = [], []
    for term in fit.terms:
        for knob in term.effect.knobs:
            if knob.name not in term.effect.settings:
                continue
            value = float(term.effect.settings[knob.name])
            step = 0.02 * value if knob.logarithmic else {"t0": 0.05, "limit": 0.01 * value}.get(knob.name, 0.02)
            sides = [remake(library, term, {**term.effect.settings, knob.name: value + s}) for s in (step, -step)]
            slope = (sides[0].columns - sides[1].columns) @ fit.theta_of(term) / (2.0 * step)
            column = np.zeros(problem.y.shape)
            if term.row is None:
                column[:] = slope
            else:
                column[:, term.row] = slope
            extra.append(column / np.sqrt(fit.variance))
            owners.append((term, knob.name, value))
    count = len(fit.theta)
    information = np.zeros((count + len(extra), count + len(extra)))
    own = np.arange(count, count + len(extra))
    for j, (index, X) in fit.blocks.items():
        every = np.concatenate([index, own])
        columns = np.concatenate([X / np.sqrt(fit.variance[:, j, None]), *(c[:, j, None] for c in extra)], axis=1)
        information[np.ix_(every, every)] += columns.T @ columns
    for term, where in zip(fit.terms, fit.slices, strict=True):
        at = np.arange(where.start, where.stop)
        information[at, at] += term.prior
    if fit.inexact:
        links = np.arange(count - len(problem.prior), count)
        information[links, links] += problem.prior
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-30))
    scaled = information * scale[:, None] * scale
    scaled[np.diag_indices(len(scaled))] += 1e-9
    inverse = np.linalg.inv(scaled) * scale[:, None] * scale
    out = {}
    for term, where in zip(fit.terms, fit.slices, strict=True):
        knobs = [i for i, (owner, _, _) in enumerate(owners) if owner is term]
        both = [*range(where.start, where.stop), *(count + i for i in knobs)]
        values = np.concatenate([fit.theta[where], [owners[i][2] for i in knobs]])
        out[term] = values, inverse[np.ix_(both, both)]
    return out
