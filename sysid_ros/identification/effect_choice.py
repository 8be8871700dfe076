"""The joints, or the arm, where an effect that is asked for predicts data that were not fitted better than what is usual."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.identification.bag_sums import BagSums
from sysid_ros.identification.held_out import Folds, Prior, Solvers
from sysid_ros.identification.least_squares import Fit, fit
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_WEIGHTS = (1.0, 10.0, 100.0, 1e3, 1e4, math.inf)
"""Weights of the prior of the links, all alike, that the joints are judged with: the best of them."""

_NONE = 1e-9
"""Part of its prior standard deviation to which a parameter is held that does not take part: zero, to rounding."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """A candidate in a model that holds it beside what it would replace.

    Attributes:
        added, replaced: indices of parameters. nonnegative: what must not be below zero, rows times the added ones.
    """

    added: tuple[int, ...]
    replaced: tuple[int, ...]
    nonnegative: FloatArray


def alternatives(model: TorqueModel, candidates: Sequence[Effect]) -> list[Alternative]:
    """Each candidate with the parameters of its family that its joints have without it."""
    blocks = list(zip(model.free, model.slices, strict=True))
    out = []
    for candidate in candidates:
        added = next(range(s.start, s.stop) for e, s in blocks if e is candidate)
        replaced = []
        for effect, where in blocks:
            if effect not in candidates and effect.family and effect.family == candidate.family:
                each = effect.p // len(effect.joints)
                replaced += [
                    where.start + each * k + i for k, j in enumerate(effect.joints) if j in candidate.joints for i in range(each)
                ]
        out.append(Alternative(tuple(added), tuple(replaced), candidate.nonnegative_rows))
    return out


def those_that_gain(
    model: TorqueModel, bags: Sequence[BagRows], asked: Sequence[Alternative], tried: int, method: str = "irls"
) -> list[int]:
    """The alternatives that differ from what they replace for certain, and improve the torque where it was not fitted.

    An alternative is judged on all joints that it loads at once, by the product of the parts of their errors that it leaves: the
    likelihood of the torque that was held out.

    Args:
        model: with all alternatives among its free effects. bags: its rows. asked: the alternatives, each judged by itself.
        tried: settings of the knobs that were searched for each. method: of the least squares.

    Returns:
        Indices of ``asked``, ascending.
    """
    added = [i for a in asked for i in a.added]
    prior = _without(Prior.of(model), added)
    plain = fit(bags, prior.mean, prior.std, method)
    folds = Folds.of(bags, replace(plain, sums=BagSums.of(bags, plain.rows)))
    solvers = Solvers.of(model, prior, plain, physical=False)
    parts = [folds.without(part) for part in range(len(folds.fitted))]

    def errors(solvers: Solvers, weight: float) -> FloatArray:
        return np.maximum(folds.errors([solvers.approximate(*data, weight) for data in parts]), 1e-300)

    by_weight = [errors(solvers, weight) for weight in _WEIGHTS]
    best = int(np.argmin([np.mean(np.log(e.mean(axis=0))) for e in by_weight]))
    before, found = by_weight[best], []
    for k, one in enumerate(asked):
        freed = _without(Prior.of(model), [*(i for i in added if i not in one.added), *one.replaced])
        after = errors(replace(solvers, prior=freed), _WEIGHTS[best])
        loaded = np.any([plain.sums.normal[:, :, i, i].sum(axis=0) > 0.0 for i in one.added], axis=0)
        ratio = np.sqrt(np.prod((after / before)[:, loaded], axis=1))
        pooled = math.sqrt(float(np.prod((after.mean(axis=0) / before.mean(axis=0))[loaded])))
        if pooled <= TOL.better and ratio.max() <= TOL.not_worse and _is_sure(plain, prior, freed, one, tried):
            found.append(k)
    return found


def _is_sure(plain: Fit, before: Prior, after: Prior, one: Alternative, tried: int) -> bool:
    """Whether the likelihood ratio of the fit is beyond chance, and nothing below zero for certain that can't be.

    A gain that is the best of many settings is that much likelier by chance (Bonferroni).
    """
    from scipy.stats import chi2, norm  # takes longer to load than the rest of the package

    gain = _explained(plain, after) - _explained(plain, before)
    chance = 2.0 * float(norm.sf(TOL.sure))
    if gain <= chi2.isf(chance / tried, max(len(one.added) - len(one.replaced), 1)):
        return False
    A = plain.information + np.diag(after.precision())
    theta, inverse = np.linalg.solve(A, plain.score + after.precision() * after.mean), np.linalg.inv(A)
    where = list(one.added)
    values, covariance = one.nonnegative @ theta[where], one.nonnegative @ inverse[np.ix_(where, where)] @ one.nonnegative.T
    return bool(np.all(values >= -TOL.sure * np.sqrt(np.diag(covariance))))


def _explained(found: Fit, prior: Prior) -> float:
    """Weighted sum of squares that the parameters explain, the prior's cost counted."""
    side = found.score + prior.precision() * prior.mean
    explained = side @ np.linalg.solve(found.information + np.diag(prior.precision()), side)
    return float(explained)


def _without(prior: Prior, parameters: Sequence[int]) -> Prior:
    """The prior that holds some parameters to their mean."""
    std = prior.std.copy()
    std[list(parameters)] *= _NONE
    return replace(prior, std=std)
