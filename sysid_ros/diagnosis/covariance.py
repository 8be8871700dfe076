"""Covariance of all parameters of a fit, the nonlinear ones included, beside what is never exactly known of a joint.

The latter, how its friction turns at a reversal or differs with direction, its torque gain, and by how much its drive is slower
than others, are columns with a prior beside the causes of every set. No cause wins over another by what they can take, and what
they could have taken is in the intervals of the others; the model itself has none of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import SCALES
from sysid_ros.diagnosis.sets.block_scatter import BlockScatter
from sysid_ros.diagnosis.sets.instants import instant_of
from sysid_ros.diagnosis.sets.never_known import GAIN_AT, dry_friction, unknown_columns, unknown_prior
from sysid_ros.diagnosis.swings import Swing, follows, has_slope, slope_of, swinging
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects.traits import Curve, Knob
from sysid_ros.estimators.symmetric import inverse_of, scaled_to_one
from sysid_ros.sample import FloatArray

_LIKELY = 0.01
"""Of the most probable inexactness of the links: what is less probable by that is not looked at."""
_OWN = np.zeros(0)
"""No probabilities of scales: that of the fit alone."""


_TOLD = 0.25
"""Part of itself to which a gain must be known to be told."""


class Estimates(NamedTuple):
    """What a fit says of one term.

    Attributes:
        values: theta of its columns, then its knobs, shape (p + k,). covariance: of them.
        scatter: how much more they scatter over time than the noise explains, variance over variance, at least 1.
        basis: the effect's parameters are ``basis @ values``; None for the identity. Those of a link are all that it is off by:
            with what every link may be inexact by, beside which its term was found.
    """

    values: FloatArray
    covariance: FloatArray
    scatter: float
    basis: FloatArray | None


class Gains(NamedTuple):
    """What a fit says of the gains of joints whose efforts may be in a unit of their own.

    Attributes:
        joints: indices, of those that moved, shape (g,). values: what the efforts are of the model's, shape (g,). covariance: of
            them, with all that what else is not exactly known has taken of them, shape (g, g). causes: those of which a wrong
            gain was found as a cause of its own.
    """

    joints: tuple[int, ...]
    values: FloatArray
    covariance: FloatArray
    causes: frozenset[int]

    def common(self) -> tuple[float, float] | None:
        """What all have but those of which a wrong gain was found, and its standard deviation; None where it is not told."""
        own = [i for i, j in enumerate(self.joints) if j not in self.causes]
        if not own:
            return None
        told = inverse_of(self.covariance[np.ix_(own, own)])
        value, std = float(told.sum(axis=0) @ self.values[own] / told.sum()), float(told.sum() ** -0.5)
        return (value, std) if std < _TOLD * abs(value) else None

    def of(self, joint: int) -> tuple[float, float] | None:
        """Value and standard deviation of one; None where it did not move, and where it is not told: it is the factor of links
        that are inexact themselves, and what is linear in both holds where it is known well."""
        if joint not in self.joints:
            return None
        i = self.joints.index(joint)
        value, std = float(self.values[i]), float(np.sqrt(self.covariance[i, i]))
        return (value, std) if std < _TOLD * abs(value) else None

    def told(self) -> Gains:
        """Those that are."""
        i = [i for i, j in enumerate(self.joints) if self.of(j)]
        return Gains(tuple(self.joints[k] for k in i), self.values[i], self.covariance[np.ix_(i, i)], self.causes)


class Uncertainty(NamedTuple):
    """What a fit says of all of its terms, the covariance of the links' inertials with everything that is in it, shape
    (10 n, 10 n), and the gains of :attr:`.Problem.gains`."""

    of: dict[Term, Estimates]
    links: FloatArray
    gains: Gains


class KnobOfTerm(NamedTuple):
    """A knob of a term: its value, the range that it can have, and the derivative of the torque by it, shape (K, n)."""

    term: Term
    knob: Knob
    value: float
    reach: float
    slope: FloatArray


def with_knobs(problem: Problem, library: Library, fit: Fit, scales: FloatArray = _OWN) -> Uncertainty:
    """Values and covariance of each term: theta of its columns, then its knobs (Gauss-Newton about the fit).

    Values are those of the posterior that the covariance is of: with what is never known of a joint beside them, and with links
    as inexact as each scale says, each scale with its probability: the rows often do not tell whether masses are off by half a
    part in a hundred or by eight, and a payload is as uncertain as they are.

    The value of a compliant joint is sought from the one that its columns were made for, with how its links swing if they are
    others: what rings shows the stiffness over the inertia. The weights are those of the coloured noise, so slow
    errors count for the few independent values that they are; what scatters more than they say is given that scatter. What is
    never known of a joint, and could have taken a part of a cause, widens it.

    Args:
        scales: probability of each of :data:`sysid_ros.diagnosis.prepare.SCALES`; empty for that of the fit alone.
    """
    knobs, count = knobs_of(library, fit), len(fit.theta)
    swings = swinging(problem, library, fit)
    parts = _parts(problem, library, fit, knobs, swings, scales)
    if swings and not follows(library, fit, swings, (best := max(parts, key=lambda x: x.weight)).moved[:count], best.gained):
        swings = ()
        parts = _parts(problem, library, fit, knobs, swings, scales)
    inexact = range(count - fit.links.shape[1], count) if fit.inexact else range(0)
    everything, bases = [*inexact], [fit.links[:, : len(inexact)]]
    out = {}
    for term, where in zip(fit.terms, fit.slices, strict=True):
        own_knobs = [i for i, knob in enumerate(knobs) if knob.term is term]
        both, basis = [*range(where.start, where.stop), *(count + i for i in own_knobs)], term.basis
        theta = _theta(fit, term)
        scatter = sum(x.weight * float(np.mean(x.ratios[both])) for x in parts)
        if term.effect.replaces_links:
            everything, bases = [*both, *everything], [term.of_links, *bases]
            both, theta = [*both, *inexact], np.concatenate([theta, fit.theta[list(inexact)]])
            basis = np.hstack([bases[0], bases[-1]])[10 * term.joints[0] : 10 * term.joints[0] + 10]
        moved, spread = _together(parts, both)
        if how := term.effect.deflection:
            spread[0, 0] += (how.form_error * float(theta[0])) ** 2
        values = np.concatenate([theta, [knobs[i].value for i in own_knobs]]) + moved
        if term.effect.instant:
            of_sizes = sum(x.weight * float(np.mean(x.ratios[both[:-1]])) for x in parts)
            values[-1], std = instant_of(problem, library, fit, term, of_sizes)
            to = np.append(np.ones(len(values) - 1), std / np.sqrt(spread[-1, -1]))
            spread = spread * to[:, None] * to
        out[term] = Estimates(values, spread, scatter, basis)
    links = np.hstack(bases)
    return Uncertainty(out, links @ _together(parts, everything)[1] @ links.T, _gains(problem, fit, parts, count + len(knobs)))


def _gains(problem: Problem, fit: Fit, parts: Sequence[_Part], first: int) -> Gains:
    """Those that are causes of their own, and those among what is never known, which begins at ``first``."""
    each = (len(parts[0].moved) - first) // max(len(fit.blocks), 1)
    causes = {t.row: where.start for t, where in zip(fit.terms, fit.slices, strict=True) if t.effect.of_own_torque}
    never = {j: first + each * i + GAIN_AT for i, j in enumerate(fit.blocks) if j in problem.gains}
    at = [causes.get(j, i) for j, i in never.items()]
    moved, covariance = _together(parts, at)
    found = np.array([fit.theta[i] if i < len(fit.theta) else 0.0 for i in at])
    return Gains(tuple(never), 1.0 + found + moved, covariance, frozenset(j for j in never if j in causes))


class _Part(NamedTuple):
    """With links of one inexactness: its probability, how far the parameters move, their covariance, how they scatter, and by
    how much likelier the rows are then, if all is linear."""

    weight: float
    moved: FloatArray
    covariance: FloatArray
    ratios: FloatArray
    gained: float


def _parts(
    problem: Problem, library: Library, fit: Fit, knobs: Sequence[KnobOfTerm], swings: Sequence[Swing], scales: FloatArray
) -> list[_Part]:
    information, score, blocks = _equations(problem, library, fit, knobs, swings)
    count = len(fit.theta)
    linear = np.delete(np.arange(len(score)), count + np.arange(len(knobs)))  # knobs stay: far off, their columns are others
    links = slice(count - len(problem.prior), count) if fit.inexact else slice(0, 0)
    parts = []
    for weight, prior in _inexactness(problem, fit, scales):
        more = np.zeros(len(score))
        more[links] = prior - problem.prior if fit.inexact else 0.0
        own, moved = information + np.diag(more), np.zeros(len(score))
        asked = score - np.concatenate([more[:count] * fit.theta, np.zeros(len(score) - count)])
        scaled, scale = scaled_to_one(own[np.ix_(linear, linear)])
        moved[linear] = np.linalg.solve(scaled, asked[linear] * scale) * scale
        gained = 0.5 * float(asked[linear] @ moved[linear])
        parts.append(_Part(weight, moved, inverse_of(own), blocks.ratios(own), gained))
    return parts


def _inexactness(problem: Problem, fit: Fit, scales: FloatArray) -> list[tuple[float, FloatArray]]:
    """Probability and inverse variances of the links' parameters of every inexactness that is worth a look."""
    if not fit.inexact or not scales.size:
        return [(1.0, problem.prior)]
    likely = [(float(weight), problem.prior_of(scale)) for weight, scale in zip(scales, SCALES, strict=True)]
    likely = [x for x in likely if x[0] > _LIKELY * float(scales.max())]
    whole = sum(weight for weight, _ in likely)
    return [(weight / whole, prior) for weight, prior in likely]


def _together(parts: Sequence[_Part], which: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Mean of how far some parameters move, and their covariance, of what is within the parts and between them."""
    weights = np.array([x.weight for x in parts])
    moved = np.stack([x.moved[list(which)] for x in parts])
    mean = weights @ moved
    covariance = np.einsum("k,ki,kj->ij", weights, moved - mean, moved - mean)
    for part in parts:
        wider = np.sqrt(part.ratios[list(which)])
        covariance += part.weight * part.covariance[np.ix_(which, which)] * wider[:, None] * wider
    return mean, covariance


def _theta(fit: Fit, term: Term) -> FloatArray:
    """Parameters of a term's columns; of a deflection those that they were made for."""
    return np.array([float(term.effect.settings["around"])]) if term.effect.deflection else fit.theta_of(term)


def knobs_of(library: Library, fit: Fit) -> list[KnobOfTerm]:
    """The knobs of all terms."""
    out = []
    for term in fit.terms:
        for knob in () if term.fixed else term.effect.knobs:
            if knob.name in term.effect.settings:
                value = float(term.effect.settings[knob.name])
                step = knob.step * value if knob.logarithmic else knob.step
                above, below = (library.remake(term, **{knob.name: x}).columns for x in (value + step, value - step))
                slope = replace(term, columns=(above - below) / (2.0 * step)).rows(_theta(fit, term))
                start, end = library.times(term.recording) if knob.name == term.effect.instant else (knob.low, knob.high)
                out.append(KnobOfTerm(term, knob, value, end - start, slope))
    return out


def _equations(
    problem: Problem, library: Library, fit: Fit, knobs: Sequence[KnobOfTerm], swings: Sequence[Swing]
) -> tuple[FloatArray, FloatArray, BlockScatter]:
    """Information of the parameters of a fit, of its knobs and of what is never known of each joint; what the rows that are left
    say of them, which is nothing but of the last, of a delay and of links that swing; and how their scores scatter."""
    count = len(fit.theta)
    swung_on = {x.term: x.slope for x in swings}
    others = [t for t in fit.terms if has_slope(t) and t not in swung_on]
    slopes = {**swung_on, **{t: slope_of(library, t) for t in others}}
    links = np.arange(count - len(problem.prior), count)
    swung = sum((x.by_links for x in swings), np.zeros_like(problem.nuisance))
    moved = sum((t.rows(fit.theta_of(t) - _theta(fit, t)) for t in swung_on), np.zeros_like(fit.residual))
    never = unknown_columns(problem, dry_friction(library.robot, fit), whole=True)
    if problem.gains:
        modelled = problem.band.rows([m.tau for m in problem.band.motions]) - fit.residual
        never[GAIN_AT][:, list(problem.gains)] = modelled[:, list(problem.gains)]
    scaled_joints = {t.row for t in fit.terms if t.effect.of_own_torque}  # whose gain is a cause of its own
    off = {t.row for t in fit.terms if _is_constant(t)}  # whose offset is a cause of its own
    first, each = count + len(knobs), len(never)
    information = np.zeros((first + each * len(fit.blocks),) * 2)
    score = np.zeros(len(information))
    blocks = BlockScatter(problem.band, len(information))
    for i, (j, (index, X)) in enumerate(fit.blocks.items()):
        X = X.copy()
        for term, slope in slopes.items():
            start = fit.slices[fit.terms.index(term)].start
            X[:, index == start] = slope[:, j, None]
            if term.effect.corrects or term in swung_on:
                score[start] += float(slope[:, j] @ (fit.residual[:, j] / fit.variance[:, j]))
        if swings:
            X[:, np.isin(index, links)] += swung[:, j]
            score[links] += swung[:, j].T @ (fit.residual[:, j] / fit.variance[:, j])
            score[index] += X.T @ (moved[:, j] / fit.variance[:, j])
        unknown = first + each * i + np.arange(each)
        links_off = max(problem.scale) if fit.inexact and j not in scaled_joints else 0.0
        free = j in problem.gains and j not in scaled_joints
        information[unknown, unknown] += unknown_prior(links_off, whole=True, level=j in off, free=free)[:each]
        every = np.concatenate([index, np.arange(count, first), unknown])
        root = np.sqrt(fit.variance[:, j, None])
        columns = np.concatenate([X, *(knob.slope[:, j, None] for knob in knobs), never[:, :, j].T], axis=1) / root
        residual = (fit.residual[:, j] + moved[:, j]) / root[:, 0]
        information[np.ix_(every, every)] += columns.T @ columns
        score[unknown] += columns[:, columns.shape[1] - each :].T @ residual
        blocks.add(columns, residual, every)
    known = np.concatenate([*(t.prior for t in fit.terms), problem.prior if fit.inexact else np.zeros(0)])
    # before any data a knob is anywhere in its range: an event in a rest that no row shows is somewhere in the recording
    known = np.concatenate([known, [12.0 / knob.reach**2 for knob in knobs]])
    information[np.arange(first), np.arange(first)] += known
    return information, score, blocks


def _is_constant(term: Term) -> bool:
    curves = term.effect.simple_curves()
    return curves is not None and bool(np.all(curves[:, 0] == Curve.ONE))
