"""What a term would gain, from the score of the present fit: fast enough to try every candidate, size and form at each step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.knobs import refine
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, Effect, forms_of
from sysid_ros.sample import FloatArray

_LEAST = 3.0
"""Likelihood that a compliance must gain on its joint's rows to be looked at on all of them: what its stiffness, damping and
motor cost a prediction. It may gain much more there, for the joints before it feel the load that swings."""
_AS_MADE_FOR = 0.2, 3.0
"""The fitted compliance over that of the columns."""
_ALIKE = 0.02
"""Part by which loads may differ (rms) for columns that are only screened."""
_UNSEEN = 1e-3
"""Part of a direction from which a parameter lies along it."""
Settings = tuple[type[Effect], Mapping[str, Any]]
Possible = Callable[[Fit, Term], bool]
Price = Callable[[Term], float]
_STANDS_IN = 5.0
"""Likelihood by which time must be better than a measured temperature, for which it only stands in."""
_RICHER = 4.0
"""Likelihood that a richer form must gain beside the present one before it is tried in its place."""


@dataclass(frozen=True, eq=False)
class Score:
    """A term with the likelihood that it would gain and the parameters that it would have, all others adjusted."""

    term: Term
    gain: float
    theta: FloatArray
    std: FloatArray


@dataclass(frozen=True, eq=False)
class Proposal:
    """Terms that would be added at once, of one effect or one on each joint, and the likelihood less its price that they gain."""

    terms: tuple[Term, ...]
    score: float
    fit: Fit

    @property
    def words(self) -> str:
        """What is proposed."""
        if self.terms[0].row is None:
            return self.terms[0].effect.label
        names = self.terms[0].effect.robot.joint_names
        on: dict[str, list[str]] = {}
        for t in self.terms:
            on.setdefault(t.effect.label, []).append(names[t.joints[0]])
        return "; ".join(f"{label} on {', '.join(joints)}" for label, joints in on.items())


class Scorer:
    """Scores terms against one fit.

    With the noise of the fit the whitened residual has a sum of squares RSS_j near K in each joint; a term that takes D_j of it
    would gain ``sum_j K / 2 log(RSS_j / (RSS_j - D_j))`` once the noise is found anew.
    """

    def __init__(self, problem: Problem, fit: Fit) -> None:
        self._fit = fit
        self._active, self._prior = problem.active, problem.prior
        self._root = 1.0 / np.sqrt(fit.variance)
        self._residual = fit.residual * self._root
        self._rss = np.maximum(np.sum(self._residual**2, axis=0), 1e-9)
        self._count: FloatArray = len(problem.y) * problem.band.counted

    def local(self, terms: Sequence[Term]) -> list[Score]:
        """Scores of terms that load one and the same joint."""
        j = terms[0].row
        assert j is not None
        if j not in self._active:
            return []
        index, X = self._fit.blocks[j]
        C = np.concatenate([t.columns for t in terms], axis=1) * self._root[:, j, None]
        B = (X * self._root[:, j, None]).T @ C
        GB = self._fit.inverse[np.ix_(index, index)] @ B
        g = C.T @ self._residual[:, j]
        starts = np.cumsum([0, *(t.p for t in terms)])
        found: dict[int, Score] = {}
        for p in dict.fromkeys(t.p for t in terms):
            which = [i for i, t in enumerate(terms) if t.p == p]
            at = starts[which][:, None] + np.arange(p)
            c, b, gb = (x[:, at].transpose(1, 0, 2) for x in (C, B, GB))
            own = c.swapaxes(1, 2) @ c
            each = _solve(own - b.swapaxes(1, 2) @ gb, g[at], np.diagonal(own, axis1=1, axis2=2))
            for i, theta, drop, std in zip(which, *each, strict=True):
                left = max(self._rss[j] - float(drop), 1e-9 * self._rss[j])
                found[i] = Score(terms[i], 0.5 * float(self._count[j] * np.log(self._rss[j] / left)), theta, std)
        return [found[i] for i in range(len(terms))]

    def _given_back(self, change: FloatArray) -> float:
        """Likelihood that the nuisance parameters gain where a term takes over what they had to explain."""
        if not self._fit.inexact:
            return 0.0
        before = self._fit.theta[-len(self._prior) :]
        after = before - change[-len(self._prior) :]
        return 0.5 * float(np.sum(self._prior * (before**2 - after**2)))

    def whole(self, term: Term) -> Score:
        """Score of a term that loads several joints."""
        active, p = self._active, term.p
        B, own, score = np.zeros((len(self._fit.theta), p)), np.zeros((p, p)), np.zeros(p)
        whitened = {int(j): term.columns[:, j] * self._root[:, j, None] for j in active}
        for j, C in whitened.items():
            index, X = self._fit.blocks[j]
            B[index] += (X * self._root[:, j, None]).T @ C
            own += C.T @ C
            score += C.T @ self._residual[:, j]
        GB = self._fit.inverse @ B
        (theta,), _, (std,) = _solve((own - B.T @ GB)[None], score[None], np.diag(own)[None])
        change = GB @ theta
        rss = np.empty(len(active))
        for i, (j, C) in enumerate(whitened.items()):
            index, X = self._fit.blocks[j]
            left = self._residual[:, j] - C @ theta + (X @ change[index]) * self._root[:, j]
            rss[i] = max(float(left @ left), 1e-9)
        gain = 0.5 * float(self._count[active] @ np.log(self._rss[active] / rss)) + self._given_back(change)
        return Score(term, gain, theta, std)


def _solve(information: FloatArray, score: FloatArray, own: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of each of several terms the parameters, shape (t, p), the drop of the sum of squares, shape (t,), and standard deviations.
    Directions that the fit has already or that nobody sees are left at zero, and what lies along them may be anything.

    Args:
        information: shape (t, p, p). score, own: shape (t, p); the latter is the information with nothing else in the fit.
    """
    scale = 1.0 / np.sqrt(np.maximum(own, 1e-30))
    values, vectors = np.linalg.eigh(information * scale[:, :, None] * scale[:, None, :])
    keep = values > 1e-9
    inverted = np.where(keep, 1.0 / np.where(keep, values, 1.0), 0.0)
    inverse = (vectors * inverted[:, None, :]) @ vectors.swapaxes(1, 2) * scale[:, :, None] * scale[:, None, :]
    theta = (inverse @ score[:, :, None])[:, :, 0]
    std = np.sqrt(np.maximum(np.diagonal(inverse, axis1=1, axis2=2), 0.0))
    std[np.any((np.abs(vectors) > _UNSEEN) & ~keep[:, None, :], axis=2)] = np.inf
    return theta, np.sum(score * theta, axis=1), std


class ComplianceScreen:
    """Elastic joints and joints with play, as terms with settings that fit the residual.

    Args:
        library: its motions; columns are kept as long as the links' torques stay the same.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        self._rows: dict[int, tuple[list[FloatArray], list[Settings], FloatArray]] = {}

    def terms(self, fit: Fit) -> list[Term]:
        """At most one term of each effect and joint."""
        out = []
        for joint, (index, X) in fit.blocks.items():
            settings, columns = self._options(joint)
            root = 1.0 / np.sqrt(fit.variance[:, joint, None])
            kinds = list(dict.fromkeys(kind for kind, _ in settings))
            present = {t.kind for t in fit.terms if t.row == joint}
            missing = [x for x in dict.fromkeys(kind.companion for kind in kinds) if x and EFFECTS[x] not in present]
            beside = np.concatenate([np.zeros((len(root), 0)), *(self._library.local(x, joint).columns for x in missing)], axis=1)
            z = fit.residual[:, joint] * root[:, 0]
            power = float(z @ z)
            M, C, known = beside * root, columns * root, X * root
            # what is there gives way as far as all rows and what is known of the links let it
            of_beside, of_each = known.T @ M, known.T @ C
            eased, eased_each = (fit.inverse[np.ix_(index, index)] @ x for x in (of_beside, of_each))
            size, cross = np.sum(C**2, axis=0) - np.sum(of_each * eased_each, axis=0), M.T @ C - eased.T @ of_each
            inverse = np.linalg.pinv(M.T @ M - of_beside.T @ eased, hermitian=True)
            size = np.maximum(size - np.sum(cross * (inverse @ cross), axis=0), 1e-30)
            theta = (C.T @ z - cross.T @ inverse @ (M.T @ z)) / size
            drop = theta**2 * size + float(z @ M @ inverse @ M.T @ z)
            gain = 0.5 * len(z) * np.log(power / np.maximum(power - drop, 1e-9 * power))
            made_for = np.array([s["around"] for _, s in settings])
            gain[(theta < _AS_MADE_FOR[0] * made_for) | (theta > _AS_MADE_FOR[1] * made_for)] = 0.0
            for kind in kinds:
                own = [i for i, (k, _) in enumerate(settings) if k is kind]
                best = own[int(np.argmax(gain[own]))]
                if gain[best] > _LEAST:
                    out.append(self._library.whole(kind.id, (joint,), **settings[best][1]))
        return out

    def _options(self, joint: int) -> tuple[list[Settings], FloatArray]:
        loads = [m.link_torque[:, joint] for m in self._library.motions]
        if joint in self._rows:
            before, settings, columns = self._rows[joint]
            if all(_alike(x, y) for x, y in zip(before, loads, strict=True)):
                return settings, columns
        motions, robot = self._library.motions, self._library.robot
        searched = [kind for kind in EFFECTS.values() if kind.deflection]
        settings = [(kind, c.settings) for kind in searched for c in kind.candidates(motions, joint)]
        name, each = [robot.joint_names[joint]], [(kind, [s for k, s in settings if k is kind]) for kind in searched]
        effects = [(kind, [kind.from_settings(robot, name, dict(s)) for s in own]) for kind, own in each if own]
        curves = [np.concatenate([kind.own_curves(motion, own) for kind, own in effects]) for motion in motions]
        columns = self._library.band.joint_curves(joint, curves)
        self._rows[joint] = loads, settings, columns
        return settings, columns


def _orthonormal(columns: FloatArray) -> FloatArray:
    """A basis of what columns (K, m) span, shape (K, r)."""
    scale = np.sqrt(np.maximum(np.sum(columns**2, axis=0), 1e-300))
    U, s, _ = np.linalg.svd(columns / scale, full_matrices=False)
    return np.asarray(U[:, s > 1e-6 * s.max(initial=0.0)])


def _alike(x: FloatArray, y: FloatArray) -> bool:
    return x.shape == y.shape and float(np.sum((x - y) ** 2)) <= _ALIKE**2 * float(np.sum(x**2))


def forms(problem: Problem, library: Library, fit: Fit, present: Term) -> list[Term]:
    """Each form of what ``present`` is a form of, at its best in its place, the simpler first; impossible ones are left out."""
    joint = present.row
    assert joint is not None
    others = [t for t in fit.terms if t is not present]
    scorer = Scorer(problem, problem.fit(others, fit.noise, 2, fit.inexact))
    beside = Scorer(problem, fit)
    found = []
    kinds = forms_of(present.effect.family)
    for kind in kinds:
        candidates = library.local_options(kind.id, joint)
        if kinds.index(kind) > kinds.index(present.kind):
            gains = [s.gain for s in beside.local(candidates)] if candidates else []
            if max(gains, default=0.0) < _RICHER:
                continue
        parts = {EFFECTS[x] for x in kind.includes}
        kept = [t for t in others if not (t.row == joint and t.kind in parts)]
        options = scorer.local(candidates) if candidates else []
        if not options:
            continue
        best = max(options, key=lambda s: s.gain).term
        trials = []
        for term in [best, *(s.term for s in options if s.term.effect.follows_temperature and s.term is not best)]:
            if kind is present.kind and present.effect.knobs and term.form == present.form:
                term = present
            trial = refine(problem, library, problem.fit([*kept, term], fit.noise, inexact=fit.inexact), [term])
            term = trial.terms[-1]
            if term.possible(trial.theta_of(term), trial.std_of(term)):
                trials.append((trial.loglik + (_STANDS_IN if term.effect.follows_temperature else 0.0), term))
        if trials:
            found.append(max(trials, key=lambda x: x[0])[1])
    return found


def met(problem: Problem, library: Library, fit: Fit) -> Fit:
    """The fit with one event in place of two that were apart and have met."""
    while pair := next((p for p in combinations(fit.terms, 2) if p[0].instant is not None and p[0].excludes(p[1])), None):
        alone = [[t for t in fit.terms if t is not x] for x in pair]
        fits = [problem.fit(terms, fit.noise, inexact=fit.inexact) for terms in alone]
        dated = [refine(problem, library, x, [t for t in x.terms if t.instant is not None]) for x in fits]
        fit = max(dated, key=lambda x: x.loglik)
    return fit


def proposal(problem: Problem, fit: Fit, terms: list[Term], possible: Possible, price: Price) -> Proposal | None:
    """Terms beside those of a fit, without what excludes them; None where those that physics allows do not gain their price."""
    new = list(terms)
    while new:
        kept = [t for t in fit.terms if not any(t.excludes(n) for n in new)]
        trial = problem.fit([*kept, *new], fit.noise, inexact=fit.inexact)
        wrong = [t for t in new if not possible(trial, t)]
        if not wrong:
            score = trial.loglik - fit.loglik - sum(map(price, new)) + sum(price(t) for t in fit.terms if t not in kept)
            return Proposal(tuple(new), score, trial) if score > 0.0 else None
        new = [t for t in new if t not in wrong]
    return None


def refined(problem: Problem, library: Library, found: Proposal) -> Proposal:
    """A proposal with its knobs where the rows are the most likely."""
    fit = refine(problem, library, found.fit, found.terms)
    terms = fit.terms[len(fit.terms) - len(found.terms) :]
    return Proposal(terms, found.score + fit.loglik - found.fit.loglik, fit)


def event(
    problem: Problem, library: Library, fit: Fit, events: Sequence[Term], possible: Possible, price: Price
) -> Proposal | None:
    """The event beside the terms of a fit that gains the most, dated; None where none gains its price."""
    scorer, new = Scorer(problem, fit), [t for t in events if not any(t.same(x) for x in fit.terms)]
    best = max(new, key=lambda t: scorer.whole(t).gain - price(t), default=None)
    found = best and proposal(problem, fit, [best], possible, price)
    return refined(problem, library, found) if found else None
