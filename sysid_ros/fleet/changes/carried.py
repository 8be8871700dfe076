"""Carried: whether all that a robot carries became heavier or lighter by the same mass, as by another tool.

A robot carries one of some things in a bag, nobody says which: its masses m_b gather about levels. They are a partition of the
bags into levels c with a Chinese restaurant's prior, each level N(0, BROAD^2), each mass N(c, std_b^2 + scatter). A tool that
changes by delta at T moves every level: the same model of ``m_b - delta [t_b >= T]`` needs fewer of them. Its Bayes factor is the
ratio of the marginal likelihoods, averaged over times (evenly) and delta (N(0, USUAL^2)). A new product alone adds a level, and
old ones go on.

Partitions are summed over exactly among those that do not interleave in mass, by dynamic programming over the sorted masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import gammaln, logsumexp

from sysid_ros.fleet.changes.series import RobotSeries
from sysid_ros.sample import FloatArray

BROAD, USUAL = 5.0, 1.0
"""Of what arms carry, and by how much tools differ [kg]."""
_CONCENTRATION = 0.5
"""Of the Chinese restaurant: three things in a year's weekly bags."""
_FINE = 1.0
"""Step of delta as a part of the standard deviation of the mean of a quarter of the bags, which is the least that the posterior
of delta can have: the sum over a Gaussian in steps of its standard deviation is its integral to 1e-8."""
_FARTHEST = 3.0
_MOST_BAGS = 120
_ODD = 1e-2
"""Share of bags whose mass is anything, that is evenly likely within BROAD."""


_APART = 3.0
"""Masses that are so many of their standard deviations apart are of two levels."""
_COARSE = 4
"""Every so many times are looked at first, and all where those tell something."""
_TELLING = -7.0
"""Logarithm of the mean Bayes factor of the times that are looked at first from which all are: the factor of the right time is
greater than that of a neighbour, and one of dozens."""
_NEGLIGIBLE = 30.0
"""Logarithm of a part of a sum that is left out."""


@dataclass(frozen=True, eq=False, slots=True)
class CarriedEvidence:
    """Of one robot.

    Attributes:
        log_e: logarithm of the e-value of a change. before, after: dates between which it began, shape (K,) [days].
        weights: posterior of them, shape (K,). delta, std: the change [kg].
    """

    log_e: float
    before: FloatArray
    after: FloatArray
    weights: FloatArray
    delta: float
    std: float


def scatter_of(robots: Sequence[RobotSeries]) -> float:
    """Variance of the masses from bag to bag beyond what is stated [kg^2], from neighbours in mass: the likeliest of a grid."""
    known = [r for r in robots if np.isfinite(r.mass).sum() > 1]
    if not known:
        return 0.0
    stated = float(np.median(np.concatenate([r.mass_std[np.isfinite(r.mass)] for r in known])) ** 2)
    grid = stated * np.array([0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
    return float(grid[int(np.argmax([sum(_alone(r, s) for r in known) for s in grid]))])


def carried_evidence(robot: RobotSeries, scatter: float) -> CarriedEvidence | None:
    """The evidence of a change of what a robot carries always, None where it has fewer than two bags with a mass."""
    known = np.flatnonzero(np.isfinite(robot.mass) & np.isfinite(robot.mass_std))
    known = known[:: max(1, -(-known.size // _MOST_BAGS))]
    if known.size < 2:
        return None
    days, mass, variance = robot.days[known], robot.mass[known], robot.mass_std[known] ** 2 + scatter
    cuts = np.flatnonzero(np.diff(days) > 0.0) + 1
    if not cuts.size:
        return None
    step = _FINE * float(np.sqrt(np.median(variance) / max(0.25 * known.size, 1.0)))
    step = max(step, 2.0 * _FARTHEST / 1500.0)
    deltas = _between_levels(mass, variance, np.arange(-_FARTHEST, _FARTHEST + step, step))
    restaurant = _restaurant(known.size)
    none = _marginal(mass, variance, restaurant)
    gaps = np.diff(days)[cuts - 1]
    log_prior = -0.5 * (deltas / USUAL) ** 2 + np.log(step / (USUAL * np.sqrt(2.0 * np.pi)))
    found = np.full((cuts.size, deltas.size), -np.inf)
    some = np.arange(cuts.size)[_COARSE // 2 :: _COARSE] if cuts.size > 3 * _COARSE else np.arange(cuts.size)
    found[some] = _all(mass, variance, cuts[some], deltas, restaurant) - none + log_prior
    if some.size < cuts.size and logsumexp(found[some]) - np.log(some.size) > _TELLING:
        near = np.flatnonzero(logsumexp(found, axis=0) > logsumexp(found) - _NEGLIGIBLE)
        found[:, near] = _all(mass, variance, cuts, deltas[near], restaurant) - none + log_prior[near]
        some = np.arange(cuts.size)
    found += np.log(gaps / gaps[some].sum())[:, None]
    total = float(logsumexp(found))
    w = np.exp(found - total)
    delta = float(w.sum(axis=0) @ deltas)
    std = float(np.sqrt(w.sum(axis=0) @ (deltas - delta) ** 2 + step**2 / 12.0))
    return CarriedEvidence(total, days[cuts - 1], days[cuts], w.sum(axis=1), delta, std)


def _between_levels(mass: FloatArray, variance: FloatArray, deltas: FloatArray) -> FloatArray:
    """Those of the deltas that lay masses on others: elsewhere a change explains nothing, and its likelihood is left out."""
    order, std = np.sort(mass), float(np.sqrt(np.median(variance)))
    groups = np.split(order, np.flatnonzero(np.diff(order) > _APART * std) + 1)
    levels = np.array([g.mean() for g in groups])
    wide = np.array([max(3.0 * std * np.sqrt(2.0 / len(g)), np.ptp(g)) for g in groups])
    near = np.abs(deltas[:, None, None] - (levels[:, None] - levels)) <= np.maximum.outer(wide, wide)
    return np.asarray(deltas[near.any(axis=(1, 2))])


def _alone(robot: RobotSeries, scatter: float) -> float:
    known = np.flatnonzero(np.isfinite(robot.mass) & np.isfinite(robot.mass_std))[:_MOST_BAGS]
    return float(_marginal(robot.mass[known], robot.mass_std[known] ** 2 + scatter, _restaurant(known.size)))


def _restaurant(n: int) -> FloatArray:
    """Logarithm of the prior of a level with k bags, (n + 1,), and the normalisation in place of k = 0."""
    k = np.arange(1, n + 1)
    whole = gammaln(_CONCENTRATION) - gammaln(_CONCENTRATION + n)
    return np.concatenate(([whole], np.log(_CONCENTRATION) + gammaln(k)))


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _marginal(mass: FloatArray, variance: FloatArray, restaurant: FloatArray) -> float:
    n = mass.size
    order = np.argsort(mass)
    # forward[i]: logarithm of the sum over partitions of the first i masses
    forward = np.full(n + 1, -np.inf)
    forward[0] = 0.0
    apart = 6.0 * np.sqrt(variance.max())
    first = 0
    odd = np.log(_ODD) - np.log(2.0 * BROAD)
    of_one = 0.5 * np.log(1.0 / (2.0 * np.pi * variance)) + np.log1p(-_ODD)
    # a term is roots * exp(powers): a square root costs less than a logarithm
    powers, roots = np.empty(n + 1), np.empty(n + 1)
    for i in range(1, n + 1):
        a, g, s, low = 1.0 / BROAD**2, 0.0, 0.0, -np.log(BROAD)
        top, last = -np.inf, mass[order[i - 1]]
        for j in range(i - 1, -1, -1):
            b = order[j]
            w = 1.0 / variance[b]
            a += w
            g += w * mass[b]
            s += w * mass[b] * mass[b]
            low += of_one[b]
            powers[j] = forward[j] + low - 0.5 * (s - g * g / a) + restaurant[i - j]
            roots[j] = 1.0 / np.sqrt(a)
            top = max(top, powers[j])
            first = j
            if powers[j] < top - _NEGLIGIBLE and last - mass[b] > apart:
                break  # lighter ones are farther still
        alone = forward[i - 1] + odd
        top = max(top, alone)
        total = np.exp(alone - top)
        for j in range(first, i):
            if powers[j] > top - _NEGLIGIBLE:
                total += roots[j] * np.exp(powers[j] - top)
        forward[i] = top + np.log(total)
    return float(forward[n] + restaurant[0])


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _all(mass: FloatArray, variance: FloatArray, cuts: FloatArray, deltas: FloatArray, restaurant: FloatArray) -> FloatArray:
    """Logarithm of the marginal likelihood for each cut and delta, shape (cuts, deltas)."""
    out = np.empty((cuts.size, deltas.size))
    moved = np.empty(mass.size)
    for c in range(cuts.size):
        for k in range(deltas.size):
            for b in range(mass.size):
                moved[b] = mass[b] - deltas[k] if b >= cuts[c] else mass[b]
            out[c, k] = _marginal(moved, variance, restaurant)
    return out
