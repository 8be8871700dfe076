"""How probable each cause of the most probable set is, and what it cannot be told from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sysid_ros.diagnosis.set_search import SetSearch, State
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS
from sysid_ros.sample import FloatArray

_DRAWS = 400
_LEAST = 0.01
"""Odds that are worth a fit, to see whether physics allows them."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Of the terms of the most probable set: probability, the part of the rest that nothing in their place has, and what the
    effects have that stand in for them."""

    probability: dict[Term, float] = field(default_factory=dict)
    nothing: dict[Term, float] = field(default_factory=dict)
    instead: dict[Term, dict[str, float]] = field(default_factory=dict)

    def of(self, same: Mapping[Term, Term]) -> Posterior:
        """The same of terms with other columns."""
        probability, nothing = ({same.get(t, t): p for t, p in part.items()} for part in (self.probability, self.nothing))
        return Posterior(probability, nothing, {same.get(t, t): others for t, others in self.instead.items()})


def posterior_of(search: SetSearch, state: State, *others: State) -> Posterior:
    """How probable each term of a set is: against the sets without it, with another in its place, or without all of its effect.

    The stretches are drawn again and again with the weights of the Bayesian bootstrap (pseudo-BMA+, Yao, Vehtari, Simpson,
    Gelman 2018): what a few of them decide is not sure.
    """
    rng = np.random.default_rng(0)
    weights = rng.dirichlet(np.ones(search.left_out.stretches), _DRAWS) * search.left_out.stretches
    own = state.predicted.likelihood
    here = search.usual(state.members)
    rivals: dict[int, list[tuple[str, FloatArray]]] = {i: [] for i in state.members}

    def compared(members: Sequence[int], likelihood: FloatArray, narrowed: float) -> FloatArray:
        odds: FloatArray = weights @ (likelihood - own) + search.usual(members) - here + state.narrowed - narrowed
        return odds

    beside = [(x.members, x.predicted.likelihood, x.narrowed) for x in (*others, *search.all_inexact(state))]
    for members, likelihood in [*search.neighbours(state), *search.replaced(state, state.members), *search.without_effect(state)]:
        beside.append((members, likelihood, state.narrowed))
    for members, likelihood, narrowed in beside:
        odds = compared(members, likelihood, narrowed)
        new = [i for i in members if i not in state.members]
        if np.mean(odds > _LEAST) > _LEAST and (lawful := search.lawful(members, state.scale)) != members:
            if new:
                continue  # likely, were it not that physics forbids it
            less = search.state(lawful, state.scale)
            odds = compared(lawful, less.predicted.likelihood, less.narrowed)
        for i in set(state.members) - set(members):
            rivals[i].append((search.pool[new[0]].id if len(new) == 1 else "", odds))
    probability: dict[Term, float] = {}
    nothing: dict[Term, float] = {}
    instead: dict[Term, dict[str, float]] = {}
    for i, against in rivals.items():
        term = search.pool[i]
        odds = np.exp(np.clip(np.stack([o for _, o in against]), -700.0, 700.0))
        share = np.mean(odds / (1.0 + np.sum(odds, axis=0)), axis=1)
        same = sum(s for (name, _), s in zip(against, share, strict=True) if EFFECTS.get(name) is term.kind)
        probability[term] = float(min(1.0 - np.sum(share) + same, 1.0))
        nothing[term] = float(sum(s for (name, _), s in zip(against, share, strict=True) if not name))
        instead[term] = {}
        for (name, _), s in zip(against, share, strict=True):
            if name and EFFECTS[name] is not term.kind:
                instead[term][name] = instead[term].get(name, 0.0) + float(s)
    return Posterior(probability, nothing, instead)
