"""The joints on which a richer model of dry friction predicts data that were not fitted better than Coulomb's does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.identification.held_out import Folds, Prior, Solvers
from sysid_ros.identification.least_squares import fit
from sysid_ros.identification.normal_equations import NormalEquations
from sysid_ros.identification.rows import BagRows
from sysid_ros.sample import FloatArray
from sysid_ros.torque.torque_model import TorqueModel

_WEIGHTS = (1.0, 10.0, 100.0, 1e3, 1e4, math.inf)
"""Weights of the prior of the links, all alike, that the joints are judged with: the best of them."""

_BETTER, _NOT_WORSE = 0.97, 1.01
"""Held-out error of a joint with the term over that without: over all splits of the data, and at most in each of them."""

_SURE = 3.0
"""Standard deviations by which the term must differ from zero."""

_NONE = 1e-9
"""Part of its prior standard deviation to which a parameter is held that does not take part."""


def joints_that_need(
    model: TorqueModel, bags: Sequence[BagRows], terms: Sequence[int], never: Sequence[int] = (), method: str = "irls"
) -> list[int]:
    """Joints whose term is above zero for certain and improves the joint's torque where it was not fitted.

    Args:
        model: with the term of every joint among its free effects. bags: its rows.
        terms: index of each joint's term among the parameters, n of them. never: parameters that take no part at all.
        method: of the least squares.

    Returns:
        Indices of joints, ascending.
    """
    prior = _without(Prior.of(model), [*terms, *never])
    plain = fit(bags, prior.mean, prior.std, method)
    folds = Folds.of(bags, replace(plain, equations=NormalEquations.of(bags, plain.rows)))
    solvers = Solvers.of(model, prior, plain, physical=False)
    parts = [folds.without(part) for part in range(len(folds.fitted))]

    def errors(solvers: Solvers, weight: float) -> FloatArray:
        return np.maximum(folds.errors([solvers.approximate(*data, weight) for data in parts]), 1e-300)

    tried = [errors(solvers, weight) for weight in _WEIGHTS]
    best = int(np.argmin([np.mean(np.log(e.mean(axis=0))) for e in tried]))
    before, needed = tried[best], []
    for j, term in enumerate(terms):
        freed = replace(solvers, prior=_without(Prior.of(model), [*(k for k in terms if k != term), *never]))
        after = errors(freed, _WEIGHTS[best])
        ratio = np.sqrt(after[:, j] / before[:, j])
        pooled = math.sqrt(after[:, j].mean() / before[:, j].mean())
        if pooled <= _BETTER and ratio.max() <= _NOT_WORSE and _is_sure(freed, plain.information, plain.score, term):
            needed.append(j)
    return needed


def _is_sure(solvers: Solvers, information: FloatArray, score: FloatArray, term: int) -> bool:
    """Whether a parameter is above zero by more than its uncertainty."""
    prior = solvers.prior
    A = information + np.diag(prior.precision())
    value = float(np.linalg.solve(A, score + prior.precision() * prior.mean)[term])
    return value > _SURE * math.sqrt(float(np.linalg.inv(A)[term, term]))


def _without(prior: Prior, parameters: Sequence[int]) -> Prior:
    """The prior that holds some parameters to their mean."""
    std = prior.std.copy()
    std[list(parameters)] *= _NONE
    return replace(prior, std=std)
