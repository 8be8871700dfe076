"""How strongly each link is held to the URDF's: the least error expected on other motions, and no joint risked for it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.identification.base_groups import widened
from sysid_ros.identification.expected_error import ExpectedError
from sysid_ros.identification.held_out import Folds, Prior, Solvers
from sysid_ros.identification.least_squares import Fit, fit
from sysid_ros.identification.link_posterior import link_posterior
from sysid_ros.identification.physical_consistency import PhysicalProblem
from sysid_ros.identification.result import PriorChoice
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.torque.torque_model import TorqueModel

WEIGHTS = (1e-6, 1e-4, 1e-2, 0.1, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, math.inf)
"""Weights of the prior that are tried; at ``inf`` a link is the URDF's, below 1 its mass only holds a place."""

_LOOSENED = 4
"""Most times that the prior of the links is loosened for the fit that the noise is learned from."""


def choose_weights(compare: Callable[[FloatArray], tuple[FloatArray, FloatArray]], links: int) -> FloatArray:
    """The weights of least cost: ``mean_j log r_j + 5 sum_j max(0, R_j - 1.02)``.

    From the URDF's links, and from the best weight below infinity for all links alike, the change of one link's weight that
    gains most, as long as one does; of both ends the better. Last, each link is held
    as firmly as costs next to nothing. The cost of a risk is finite: where all joints but one gain much, that one must not keep
    them from it.

    Args:
        compare: r and R, shape (n,) each: squared errors expected and at their worst, in parts of those with the URDF's links,
            for weights of the links, shape (k,). links: k.

    Returns:
        shape (k,), ``inf`` for links that keep the URDF's inertials.

    Raises:
        DataError: an error is not finite.
    """
    known: dict[tuple[float, ...], float] = {}

    def cost(weights: FloatArray) -> float:
        key = tuple(weights.tolist())
        if key not in known:
            expected, worst = compare(weights)
            if not (np.isfinite(expected).all() and np.isfinite(worst).all()):
                raise DataError("the expected torque error is not finite; a recording holds NaN or infinite values.")
            known[key] = float(
                np.mean(np.log(expected)) + TOL.risk_cost * np.sum(np.maximum(worst - 1.0 - TOL.risk_allowed, 0.0))
            )
        return known[key]

    def descend(best: FloatArray) -> FloatArray:
        for _ in range(6 * links):
            # of equals the firmest
            changed = [_with(best, k, w) for k in range(links) for w in reversed(WEIGHTS) if w != best[k]]
            following = min(changed, key=cost)
            if cost(following) > cost(best) - TOL.gain:
                break
            best = following
        return best

    # from the URDF's links no single link may gain where several at once do
    loosest = min((np.full(links, w) for w in reversed(WEIGHTS[:-1])), key=cost)
    best = min((descend(np.full(links, math.inf)), descend(loosest)), key=cost)
    most = cost(best) + TOL.firmer
    while firmer := [_with(best, k, WEIGHTS[WEIGHTS.index(w) + 1]) for k, w in enumerate(best.tolist()) if math.isfinite(w)]:
        following = min(firmer, key=cost)
        if cost(following) > most:
            break
        best = following
    return best


def fitted(
    model: TorqueModel, bags: Sequence[BagRows], prior: Prior, method: str, base: FloatingBase | None = None
) -> tuple[Prior, Fit]:
    """The unconstrained fit, and the prior that it goes by: of links that may be as far off as the data are likeliest with.

    A link that only holds a place in the URDF is off by many times its mass. A prior that knows of none such leaves its torque
    in the residuals, where it is taken for noise, beside which the data weigh too little to move the prior. On legs, ``base``,
    the URDF's links stand, and bags that differ widen the covariance.
    """
    found, least = fit(bags, prior.mean, prior.std, method), 1.0
    if base:
        return prior, widened(found, prior)
    for _ in range(_LOOSENED):
        weight = link_posterior(bags, found, Solvers.of(model, prior, found, False)).weight
        if weight >= least:
            break
        prior = replace(prior, std=np.where(prior.is_link, np.sqrt(least / weight), 1.0) * prior.std)
        found, least = fit(bags, prior.mean, prior.std, method), weight
    return prior, found


def choose_prior(bags: Sequence[BagRows], folds: Folds, solvers: Solvers, found: Fit, given: float | None) -> PriorChoice:
    """The weights of the prior: as given, else by the error expected on other motions.

    The error on held-out parts of the same recordings is worked out beside it for one weight for all links. It does not decide:
    parts of a short recording share its noise and its postures, and seldom separate one link's inertials from another's.
    """
    names = tuple(solvers.model.robot.body_names[j] for j in solvers.link_joints)
    if given is not None:
        return PriorChoice(given, (given,), (math.nan,), "as given", names, (given,) * len(names))
    expected = ExpectedError(bags, found, solvers, link_posterior(bags, found, solvers))
    weights = choose_weights(expected.compare, len(names))
    kept = [name for name, w in zip(names, weights, strict=True) if math.isinf(w)]
    if len(kept) == len(names):
        reason = "no other inertials than the URDF's are expected to predict other motions better without a risk for some joint"
    else:
        reason = "the least torque error expected on other motions, with no joint at risk of more than with the URDF's own links"
        if kept:
            reason += f"; the URDF's inertials of {', '.join(kept)} are kept, the data do not improve them"
    parts = [folds.without(part) for part in range(len(folds.fitted))]
    errors = [folds.errors([solvers.approximate(*data, w) for data in parts]).mean(axis=0) for w in WEIGHTS]
    ratios = np.maximum(np.array(errors), 1e-300) / np.maximum(errors[-1], 1e-300)
    heldout = np.exp(0.5 * np.mean(np.log(ratios), axis=1))
    return PriorChoice(min(weights, default=math.inf), WEIGHTS, tuple(heldout.tolist()), reason, names, tuple(weights.tolist()))


def prior_on_legs(solvers: Solvers, given: float | None) -> PriorChoice:
    """The weights of the prior of a robot on legs: as given, else by how inexact a URDF usually is.

    Held-out recordings do not tell: there are a few gaits, what impacts leave is another error in each, and what one of them does
    not show of a link the others do.
    """
    joints = solvers.link_joints
    names = tuple(solvers.model.robot.body_names[j] for j in joints)
    if given is not None:
        return PriorChoice(given, (given,), (math.nan,), "as given", names, (given,) * len(names))
    weights = tuple(TOL.trunk_weight if j == FREE - 1 else TOL.leg_weight for j in joints)
    reason = (
        f"the trunk's inertials are expected to be off by {100 * TOL.trunk_weight**-0.5:.0f} %, which is what is mounted on it, "
        f"and those of the legs by {100 * TOL.leg_weight**-0.5:.0f} %"
    )
    return PriorChoice(min(weights), (min(weights),), (math.nan,), reason, names, weights)


def precision_on_legs(model: TorqueModel, base: FloatingBase) -> FloatArray:
    """What is known of a robot on legs before any recording, as :func:`.identify_on_legs` goes by it, shape (p, p)."""
    prior, none = Prior.of(model, base), np.zeros(model.p)
    root = np.zeros(model.p)
    joints = [int(j) for effect in model.free if effect.replaces_links for j in effect.joints]
    root[prior.is_link] = np.repeat([TOL.trunk_weight if j == FREE - 1 else TOL.leg_weight for j in joints], 10)
    root = np.sqrt(root)
    curvature = PhysicalProblem(model, np.zeros((model.p, model.p)), none).prior_curvature
    return np.asarray(root[:, None] * curvature * root + np.diag(np.where(prior.is_link, 0.0, prior.precision())))


def _with(weights: FloatArray, k: int, weight: float) -> FloatArray:
    changed = weights.copy()
    changed[k] = weight
    return changed
