"""From the terms of a fit to findings: which of them are claimed, with what evidence, at what share of the error."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from sysid_ros.diagnosis.covariance import Estimates, Gains, Uncertainty, with_knobs
from sysid_ros.diagnosis.drift_cause import SIGNATURE, drift_cause
from sysid_ros.diagnosis.evidence import Evidence, Part, fewest, removed_power, shapley
from sysid_ros.diagnosis.fit import Fit, Problem, visible
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.result import Finding
from sysid_ros.diagnosis.sets.posterior import Posterior, rivals
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.sets.taken_away import TakenAway
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import Parameter, Scope, named
from sysid_ros.effects.parameter import by_delta_method
from sysid_ros.effects.wording import of_joints
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

LIKELIER = 0.5
"""Probability from which a cause is likelier than not."""


class Selected(Protocol):
    """A search that has ended: its candidates, what it has found, how many it tried, and what was usual before any data."""

    tried: int
    prior: SetPrior

    @property
    def library(self) -> Library: ...
    @property
    def fit(self) -> Fit: ...


@dataclass(frozen=True, eq=False)
class Judged:
    """A fit and what it is judged on.

    Attributes:
        train: what was fitted. selection: with the fit. posterior: of its terms. held: what was not fitted.
    """

    train: Prepared
    selection: Selected
    posterior: Posterior
    held: HeldOut

    @cached_property
    def values(self) -> Uncertainty:
        """Of each term, with their covariance: that beside links as inexact as they may be, even if exact ones predict better."""
        return self._uncertain(self.train.problem)

    def gains(self, joints: Collection[int], carried: bool = False) -> Gains:
        """Of joints whose efforts may be in a unit of their own; ``carried``: beside a body that the robot may carry, which
        efforts in unknown units tell little of."""
        asked, terms = copy(self.train.problem), self.fit.terms
        asked.gains = tuple(joints)
        if carried and not any(t.effect.carried for t in terms):
            library = self.selection.library
            always = library.whole_options(lambda kind: kind.carried and not kind.instant and not kind.of_recording)
            terms = (*terms, min(always, key=lambda t: t.cost))
        elif asked.gains == self.train.problem.gains:
            return self.values.gains
        return self._uncertain(asked, terms).gains

    def _uncertain(self, problem: Problem, terms: tuple[Term, ...] | None = None) -> Uncertainty:
        fit, scales = self.fit, self.posterior.scales
        if terms is not None and terms != fit.terms:
            fit = problem.fit(terms, fit.noise, 0, inexact=fit.inexact)
        if not fit.inexact and scales.size and scales[0] < 0.5:
            fit = problem.fit(fit.terms, fit.noise, 0, inexact=True)
        return with_knobs(problem, self.selection.library, fit, scales)

    @cached_property
    def probability(self) -> dict[Term, float]:
        """Of each term: as the posterior of the sets has it, and no more than its parameters with all that their interval holds,
        what is never known of a joint and what scatters over time among it, allow."""
        out, terms = dict[Term, float](), self.fit.terms
        for term in terms:
            found, own = self.values.of[term], slice(0, term.p)
            others = [t for t in terms if t is not term]
            surely = self.selection.prior.surely(term, others, found.values[own], found.covariance[own, own])
            out[term] = min(self.posterior.probability[term], surely, self.not_unknown.get(term, 1.0))
        return out

    def in_another_form(self, term: Term) -> float:
        """Probability that all joints share what a term is in another form: that is there, and this the form it is told in."""
        if term.kind.scope is not Scope.ARM or not term.effect.family:
            return 0.0
        others = self.posterior.instead.get(term, {}).items()
        return sum(p for name, p in others if (kind := named(name)) and kind.family == term.effect.family)

    @cached_property
    def not_unknown(self) -> dict[Term, float]:
        """Of each term that takes measured torque away: that it does, and that torque is not of what no effect describes."""
        away = TakenAway(self.train, self.held, self.selection.library, self.fit, self.selection.prior)
        return {t: away.probability(t, t.row) for t in self.fit.terms if t.effect.from_measured and t.row is not None}

    @property
    def robot(self) -> RobotModel:
        """The nominal model."""
        return self.selection.library.robot

    @property
    def fit(self) -> Fit:
        """The extended model."""
        return self.selection.fit

    @cached_property
    def after(self) -> FloatArray:
        """Rows that the extended model leaves of ``held``, shape (K, n)."""
        return self.held.residual(self.fit)

    @cached_property
    def noise(self) -> FloatArray:
        """Variance of the rows of ``held``, shape (K, n)."""
        band = self.held.prepared.band
        return np.asarray(self.fit.noise.along(band) * band.counted)

    @cached_property
    def floor(self) -> FloatArray:
        """Rms of the noise of each joint, shape (n,) [N m]."""
        return self.held.rms(np.sqrt(self.noise))

    @cached_property
    def weight(self) -> FloatArray:
        """Of each joint's mean square, 0 where it does not move, shape (n,)."""
        weight, active = np.zeros(self.robot.n), self.train.problem.active
        weight[active] = 1.0 / np.maximum(self.floor[active], 1e-9) ** 2
        return weight

    def power(self, rows: FloatArray) -> FloatArray:
        """Of rows, over that of the joint's noise, shape (n,)."""
        power: FloatArray = self.held.rms(rows) ** 2 * self.weight
        return power


def claims(judged: Judged) -> list[Finding]:
    """The findings of a fit, each with its share of the held-out error, in order of their shares; on the joints on which each is
    likelier than not, its share with what it may have on others."""
    fit, out = judged.fit, list[Finding]()
    groups = list(_groups(fit.terms).values())
    rich = _beside_simplest(fit.terms, judged.robot.n)
    parts = _parts(judged, groups, rich)
    count = len(groups) + fit.inexact
    removes = removed_power(judged.train.problem, judged.held, fit, parts, judged.weight)
    shares = shapley(removes, count)
    for i, terms in enumerate(groups):
        if not any(t.effect.notable(fit.theta_of(t)) for t in terms):
            continue  # in the model, but no fault
        if not any(visible(judged.train.problem, fit, t) for t in terms):
            continue  # in the model, but too small to tell
        told = [t for t in terms if judged.probability[t] + judged.in_another_form(t) > LIKELIER]
        if not told:
            continue  # in the model as in the plainest one, but not told
        others = [p.term for p in parts if i not in p.of and (p.unless is None or p.unless == i)]
        evidence = replace(_evidence(judged, terms, others), gain=float(shares[i]))
        out.append(_finding(judged, told, [t for t in rich if t.simplest is terms[0].kind], evidence))
    return with_headline(_companions_last(out))


def with_headline(findings: Sequence[Finding]) -> list[Finding]:
    """The findings of which those of the headline are marked: the fewest that make nearly all of what all causes remove."""
    main = fewest([f.heldout_gain or 0.0 for f in findings])
    return [replace(f, headline=i in main) for i, f in enumerate(findings)]


def _parts(judged: Judged, groups: Sequence[list[Term]], rich: Sequence[Term]) -> list[Part]:
    """The terms by their group. A richer form of dry friction adds to the simplest, which the other joints have: without the
    richer its joint has the simplest, without the simplest it has none."""
    simple = {terms[0].kind: i for i, terms in enumerate(groups)}
    parts = []
    for i, terms in enumerate(groups):
        for term in terms:
            kind = term.simplest
            if term not in rich or kind is None:
                parts.append(Part(term, frozenset({i})))
                continue
            plain = judged.selection.library.local(kind.id, term.joints[0])
            parts += [Part(term, frozenset({i, simple[kind]})), Part(plain, frozenset({simple[kind]}), i)]
    return parts


def _evidence(judged: Judged, terms: Sequence[Term], others: Sequence[Term]) -> Evidence:
    """Of some terms against a model of all others."""
    fit, train = judged.fit, judged.train
    rest = train.problem.fit(others, fit.noise, inexact=fit.inexact)
    rise = 2.0 * (fit.loglik - rest.loglik) / max(judged.values.of[t].scatter for t in terms)
    on = train.problem.active if terms[0].row is None else [j for t in terms for j in t.joints]
    rows = len(train.band.f) * float(np.sum(train.band.counted[on]))
    return Evidence(rise, sum(t.cost for t in terms), rows, judged.selection.tried)


def _finding(judged: Judged, terms: Sequence[Term], richer: Sequence[Term], evidence: Evidence) -> Finding:
    robot, fit, effect = judged.robot, judged.fit, terms[0].effect
    named = sorted([*terms, *richer], key=lambda t: t.joints)
    if richer:
        parameters = tuple(_dry_friction(t, judged.values.of[t]) for t in named)
    else:
        parameters = tuple(p for t in terms for p in _parameters(t, judged.values.of[t]))
    joints = tuple(dict.fromkeys(robot.joint_names[j] for t in named for j in t.joints))
    drift = drift_cause(judged.train.problem, judged.selection.library, fit, judged.held, list(terms), judged.floor)
    return Finding(
        id=effect.id,
        label=effect.label,
        joints=joints,
        parameters=parameters,
        probability=max(judged.probability[t] for t in terms),
        **evidence.figures(),
        cannot_be_told_from=rivals(judged.train.problem, judged.selection.library, fit, judged.posterior, list(terms)),
        words=effect.in_words(parameters, of_joints(joints, robot.n)),
        signature=SIGNATURE if drift is not None and drift.over == "temperature" else effect.signature,
        separated_by=effect.separated_by,
        drift=None if drift is None else drift.as_dict(),
        remark="" if drift is None else drift.in_words(),
    )


def _companions_last(findings: Sequence[Finding]) -> list[Finding]:
    """In order of gain; what an effect brings along comes after it, whichever gains more."""
    by_name: dict[str, list[Finding]] = {}
    for f in findings:
        by_name.setdefault(f.id, []).append(f)

    def key(f: Finding) -> tuple[float, bool]:
        own = f.heldout_gain or 0.0
        kind = named(f.id)
        brings = [g for g in by_name.get(kind.companion if kind else "", ()) if set(g.joints) <= set(f.joints)]
        return max([own, *(g.heldout_gain or 0.0 for g in brings)]), bool(brings)

    return sorted(findings, key=key, reverse=True)


def _groups(terms: Sequence[Term]) -> dict[tuple[str, str], list[Term]]:
    """Terms of one finding: those of one effect, but for what keeps them apart, as an event."""
    groups: dict[tuple[str, str], list[Term]] = {}
    for term in sorted(terms, key=lambda t: t.joints):
        groups.setdefault((term.id, term.effect.apart), []).append(term)
    return groups


def _beside_simplest(terms: Sequence[Term], n: int) -> list[Term]:
    """Richer forms of dry friction where most joints have the simplest: their level is named with the others'."""
    out = []
    rubbing = [t for t in terms if t.effect.as_dry_friction(np.ones(t.effect.p)).any()]
    for kind in dict.fromkeys(t.simplest for t in rubbing if t.simplest):
        plain, rich = [t for t in rubbing if t.kind is kind], [t for t in rubbing if t.simplest is kind]
        if len(plain) >= len(rich) and len(plain) + len(rich) > n // 2:
            out += rich
    return out


def _parameters(term: Term, found: Estimates) -> list[Parameter]:
    return term.effect.as_parameters(found.values, found.covariance, found.basis)


def _dry_friction(term: Term, estimates: Estimates) -> Parameter:
    """The level of dry friction that any form of it has on its joint."""
    effect, (joint, *_) = term.effect, term.joints

    def level(x: FloatArray) -> float:
        return float(effect.as_dry_friction(x[: effect.p])[joint])

    return by_delta_method("Fc", effect.robot.joint_names[joint], effect.units[0], level, *estimates[:2])
