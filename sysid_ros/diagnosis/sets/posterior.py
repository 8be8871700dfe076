"""How probable each cause of the most probable set is, and which other effects it cannot be told from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.knobs import made_anew
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import torques
from sysid_ros.diagnosis.set_search import SetSearch
from sysid_ros.diagnosis.sets.state import State, Weighed
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, named
from sysid_ros.sample import FloatArray

_DRAWS = 400
_LEAST = 0.01
"""Odds that are worth a fit, to see whether physics allows them."""
_NAMED = 0.05  # of the probability, from which on a rival is named
_DISTINCT = 5.0
"""Log-likelihood by which a rival must be worse to be distinct from a finding."""


Anew = Callable[[Fit, bool], Fit]


@dataclass(frozen=True, eq=False)
class Posterior:
    """Of the terms of the most probable set: probability, the part of the rest that nothing in their place has, and what the
    effects have that stand in for them; and how probable each inexactness of the links is beside them, shape (scales,)."""

    probability: dict[Term, float] = field(default_factory=dict)
    nothing: dict[Term, float] = field(default_factory=dict)
    instead: dict[Term, dict[str, float]] = field(default_factory=dict)
    scales: FloatArray = field(default_factory=lambda: np.zeros(0))

    def of(self, same: Mapping[Term, Term]) -> Posterior:
        """The same of terms with other columns."""
        probability, nothing = ({same.get(t, t): p for t, p in part.items()} for part in (self.probability, self.nothing))
        return Posterior(probability, nothing, {same.get(t, t): others for t, others in self.instead.items()}, self.scales)


def posterior_of(
    search: SetSearch, state: State, *others: State, anew: Anew = lambda fit, refined: fit, elsewhere: Sequence[Weighed] = ()
) -> Posterior:
    """How probable each term of a set is: against the sets without it, with another in its place, or without all of its effect.

    What depends on torques and stands in for a cause is weighed with columns of the torques that there are without that cause:
    with those that the cause has a part in, a gain is a payload that is a little heavier.

    The stretches are drawn again and again with the weights of the Bayesian bootstrap (pseudo-BMA+, Yao, Vehtari, Simpson,
    Gelman 2018): what a few of them decide is not sure. And where a term's parameters scatter from stretch to stretch more than
    the noise explains, its rows tell as many times less: the likelihood is tempered by that ratio (Holmes, Walker 2017), as its
    interval is widened. What stays in the model is asked without that: there it costs nothing.

    Args:
        others: sets that are rivals, too. anew: a fit with columns of its own torques, refined or not. elsewhere: rivals, as
            they are on rows of their own.
    """
    rng = np.random.default_rng(0)
    weights = rng.dirichlet(np.ones(search.left_out.of_each.stretches), _DRAWS) * search.left_out.of_each.stretches
    own = state.likelihood
    here = search.usual(state.members, state.scale)
    rivals: dict[int, list[_Rival]] = {i: [] for i in state.members}
    scatter = _scatter(search, state)

    def compared(x: State | Weighed) -> tuple[FloatArray, float]:
        more: FloatArray = weights @ (x.likelihood - own)
        return more, search.usual(x.members, x.scale) - here + state.narrowed - x.narrowed

    beside: list[State | Weighed] = [*elsewhere, *others, *search.all_inexact(state)]
    for members, likelihood in [*search.neighbours(state), *search.replaced(state, state.members), *search.without_effect(state)]:
        beside.append(Weighed(members, state.scale, likelihood, state.narrowed, 0.0))
    for x in beside:
        members, (more, usual) = x.members, compared(x)
        new = [i for i in members if i not in state.members]
        here_too = x not in elsewhere
        if here_too and np.mean(more + usual > _LEAST) > _LEAST and (lawful := search.lawful(members, state.scale)) != members:
            if new:
                continue  # likely, were it not that physics forbids it
            more, usual = compared(search.state(lawful, state.scale))
        if here_too and any(search.pool[i].on_torques for i in new) and np.mean(more + usual > _LEAST) > _LEAST:
            more = more - _stale(search, members, state.scale, anew)
        for i in set(state.members) - set(members):
            rivals[i].append(_Rival(search.pool[new[0]].id if len(new) == 1 else "", more, usual))
    probability: dict[Term, float] = {}
    nothing: dict[Term, float] = {}
    instead: dict[Term, dict[str, float]] = {}
    for i, against in rivals.items():
        term = search.pool[i]
        told = _shares(against, scatter[i])
        same = sum(s for rival, s in zip(against, told, strict=True) if named(rival.name) is term.kind)
        probability[term] = float(min(1.0 - np.sum(told) + same, 1.0))
        nothing[term] = float(sum(s for rival, s in zip(against, _shares(against, 1.0), strict=True) if not rival.name))
        instead[term] = {}
        for rival, s in zip(against, told, strict=True):
            if rival.name and named(rival.name) is not term.kind:
                instead[term][rival.name] = instead[term].get(rival.name, 0.0) + float(s)
    return Posterior(probability, nothing, instead, search.odds_of_scales(state.members))


def on_own_torques(
    problem: Problem, library: Library, fit: Fit, refined: bool, links: Sequence[FloatArray], nominal: Sequence[FloatArray]
) -> Fit:
    """A fit with columns of its own torques, of rows and of a library that stay as they are; the others as
    :func:`.made_anew` has them."""
    rows, own = copy(problem), copy(library)
    own.band = copy(library.band)
    own.update(*torques(own, fit, links, nominal))
    return made_anew(rows, own, fit, links, nominal, refined)


def _stale(search: SetSearch, members: Sequence[int], scale: int, anew: Anew) -> float:
    """Log-likelihood of a set that it owes to columns of the torques of another one."""
    before = search.problem.scale
    fit = search.fit(members, scale)
    stale = fit.loglik - anew(fit, False).loglik
    if stale > 0.0:  # knobs that are where the rows are the likeliest owe less, or nothing
        stale = fit.loglik - anew(fit, True).loglik
    search.problem.scale = before
    return max(stale, 0.0)


def _scatter(search: SetSearch, state: State) -> dict[int, float]:
    """By how much more the parameters of each member scatter over time than the noise explains, variance over variance."""
    ratios = search.left_out.scatter(state.predicted)
    ends = np.cumsum([search.pool[i].p for i in state.members])
    return {i: float(np.mean(ratios[end - search.pool[i].p : end])) for i, end in zip(state.members, ends, strict=True)}


class _Rival(NamedTuple):
    """A set without a term: the effect that stands in for it, else an empty name; log-likelihood with each draw of the stretches,
    shape (draws,), and log-prior, both less those of the set with the term."""

    name: str
    more: FloatArray
    usual: float


def _shares(against: Sequence[_Rival], scatter: float) -> FloatArray:
    """Probability of each rival of a term, shape (rivals,); ``scatter``: what the likelihood is tempered by."""
    odds = np.exp(np.clip(np.stack([rival.more / scatter + rival.usual for rival in against]), -700.0, 700.0))
    return np.asarray(np.mean(odds / (1.0 + np.sum(odds, axis=0)), axis=1))


def rivals(problem: Problem, library: Library, fit: Fit, posterior: Posterior, terms: Sequence[Term]) -> tuple[str, ...]:
    """Ids of the effects that explain the rows as well as the terms of a finding do, the likeliest first.

    Args:
        terms: of the finding, all of them in the fit.
    """
    names = _same_while_moving(problem, library, fit, terms)
    if len(terms) == 1:
        names += terms[0].effect.same_torque(fit.theta_of(terms[0]), library.motions)
    shares: dict[str, float] = {}
    for term in terms:
        for name, share in posterior.instead.get(term, {}).items():
            shares[name] = max(shares.get(name, 0.0), share)
    names += [name for name in sorted(shares, key=lambda x: -shares[x]) if shares[name] > _NAMED]
    return tuple(dict.fromkeys(names))


def _same_while_moving(problem: Problem, library: Library, fit: Fit, terms: Sequence[Term]) -> list[str]:
    """Effects whose torques add up to that of the terms while the joints move, and those to which they add with others.

    A level forward and another one backward are their mean and a constant, ``F+ = Fc + o``, ``F- = Fc - o``. A rest does not tell
    either: dry friction is anything between ``-F-`` and ``F+`` there, which is ``o - Fc`` to ``o + Fc``.
    """
    kind = terms[0].kind
    out: list[str] = []
    if parts := kind.sum_of:
        other = [_in_place(library, t, part) for part in parts for t in terms]
        other = [t for t in other if not any(t.key == x.key for x in fit.terms)]
        out += parts if _as_likely(problem, fit, terms, other) else ()
    for whole in EFFECTS.values():
        kinds = [EFFECTS[part] for part in whole.sum_of]
        if kind not in kinds:
            continue
        rows = dict.fromkeys(t.row for t in terms if t.row is not None)
        groups = [[t for t in fit.terms if t.row == row and t.kind in kinds] for row in rows]
        groups = [sorted(g, key=lambda t: kinds.index(t.kind)) for g in groups if len(g) == len(kinds)]
        other = [_in_place(library, g[0], whole.id) for g in groups]
        if groups and _as_likely(problem, fit, [t for g in groups for t in g], other):
            out.append(whole.id)
    return out


def _in_place(library: Library, term: Term, name: str) -> Term:
    """Another effect on the joint of a term, with those of its settings that are the other's knobs too."""
    knobs = {k.name for k in EFFECTS[name].knobs}
    settings = {k: x for k, x in term.effect.settings.items() if k in knobs}
    return library.local(name, term.joints[0], **settings)


def _as_likely(problem: Problem, fit: Fit, terms: Sequence[Term], others: Sequence[Term]) -> bool:
    rest = [t for t in fit.terms if t not in terms]
    trial = problem.fit([*rest, *others], fit.noise, inexact=fit.inexact)
    return trial.loglik > fit.loglik - _DISTINCT
