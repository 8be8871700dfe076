"""Evidence: whether and what changed in the series of one joint, by marginal likelihoods of one Gaussian model.

The estimates of all parameters of a joint and all its bags are one vector y with a covariance C: what each bag states (with the
correlations between the parameters), scatter, wandering level and covariates (:mod:`.pooled`). A change of parameter p with the
shape f(t) and a size that is N(0, A^2) adds ``A^2 d d'`` to C, d being f at the bags in the rows of p: its Bayes factor is::

    BF = (1 + A^2 i)^-1/2 exp(1/2 A^2 z^2 / (1 + A^2 i)),   i = d' C^-1 d,  z = d' C^-1 y

Shapes are steps and ramps that begin at any time, and, as what is no change, one bag that is odd. What a joint's torque gain,
offset and zero have in common in a bag's errors stands in C: which of them changed is told by the likelihood, not by a rule.

The mean of BF over shapes, times, sizes and parameters is an e-value: where nothing changed its expectation is 1 (Grünwald, de
Heide, Koolen 2024), whatever is being tested beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import lapack
from scipy.special import logsumexp

from sysid_ros.sample import FloatArray

RAMPS = (20.0, 40.0, 60.0, 90.0, 150.0)
"""Lengths of ramps [days]; a change that is faster is a step at the pace of the bags."""
SIZES = (1.0, 3.0, 10.0, 30.0, 100.0)
"""Of changes, in standard deviations of one bag's estimate, alike probable: a mixture that any size is near to."""
_ODD = 0.2
"""Prior probability that some bag of a joint's is odd."""
_MOST_DATES = 80
_KEEP = 40
"""Hypotheses that stand for a change once it is known."""
_NAT = 4
"""Times within each gap between bags at which a ramp may begin."""


@dataclass(frozen=True, eq=False, slots=True)
class Shapes:
    """Time courses of changes: f (N, K) at the bags, ``begin`` and ``end`` of each between which it begins (K,) [days], its
    ``length`` (K,) [days], 0 for a step, and the logarithm of its prior probability ``log_prior`` (K,)."""

    f: FloatArray
    begin: FloatArray
    end: FloatArray
    length: FloatArray
    log_prior: FloatArray


def shapes(days: FloatArray) -> Shapes:
    """Steps between any two bags, and ramps; half of the prior for either, evenly in time."""
    gaps = [(days[b - 1], days[b]) for b in range(1, len(days)) if days[b] > days[b - 1]]
    while len(gaps) > _MOST_DATES:
        gaps = [(a[0], b[1]) for a, b in zip(gaps[::2], [*gaps[1::2], gaps[-1]], strict=False)]
    f: list[FloatArray] = []
    rows: list[tuple[float, float, float, float]] = []  # begin, end, length and weight
    whole = sum(b - a for a, b in gaps)
    for a, b in gaps:
        f.append((days >= b).astype(float))
        rows.append((a, b, 0.0, 0.5 * (b - a) / whole))
        for ramp in RAMPS:
            edges = np.linspace(a, b, _NAT + 1)
            for low, high in pairwise(edges.tolist()):
                course = np.clip((days - 0.5 * (low + high)) / ramp, 0.0, 1.0)
                # what ends before the next bag is a step
                if np.sum((course > 0.0) & (course < 1.0)) and course[-1] > 0.0:
                    f.append(course)
                    rows.append((low, high, ramp, 0.5 * (high - low) / whole / len(RAMPS)))
    if not f:
        return Shapes(np.zeros((len(days), 0)), *(np.zeros(0) for _ in range(4)))
    begin, end, length, weight = np.array(rows).T
    return Shapes(np.array(f).T, begin, end, length, np.log(weight / weight.sum()))


@dataclass(frozen=True, eq=False, slots=True)
class Round:
    """One look at a joint: what its series say beyond the changes that are known already.

    Attributes:
        log_e: logarithm of the e-value of a change. log_of: logarithm of the Bayes factor of each parameter, shape (P,).
        log_odd: that of an odd bag. weights: posterior of sizes, shapes for each parameter, (P, A, K), each parameter's sum is 1.
        size, size_variance: of the change by hypothesis, shape (P, A, K).
    """

    log_e: float
    log_of: FloatArray
    log_odd: float
    weights: FloatArray
    size: FloatArray
    size_variance: FloatArray
    _odd: tuple[int, int, float]


class JointEvidence:
    """The Gaussian model of one joint.

    Args:
        y: estimates minus what is expected, shape (N, P), NaN where there is none. covariance: of all that is no change, shape
            (N, P, N, P). one_bag: standard deviation of one bag's estimate, shape (P,). shapes: of changes.
    """

    def __init__(self, y: FloatArray, covariance: FloatArray, one_bag: FloatArray, shapes: Shapes) -> None:
        n, p = y.shape
        self.shapes, self.one_bag, self.p, self.n = shapes, one_bag, p, n
        self.known = np.isfinite(y)
        k = np.flatnonzero(self.known.reshape(-1))
        self._precision = np.zeros((n * p, n * p))
        self._precision[np.ix_(k, k)] = _inverse(covariance.reshape(n * p, n * p)[np.ix_(k, k)])
        self._y = np.where(self.known, y, 0.0).reshape(-1)
        self._sizes = np.array(SIZES)

    def look(self) -> Round:
        """The evidence of one more change."""
        L = self._precision.reshape(self.n, self.p, self.n, self.p)
        g = (self._precision @ self._y).reshape(self.n, self.p)
        f, A2 = self.shapes.f, (self._sizes[None, :] * self.one_bag[:, None]) ** 2
        told = np.array([np.einsum("nk,nm,mk->k", f, L[:, p, :, p], f, optimize=True) for p in range(self.p)])
        log_bf, size, variance = _factors(told[:, None, :], (g.T @ f)[:, None, :], A2[:, :, None])
        log_w = log_bf + self.shapes.log_prior - np.log(len(SIZES))
        log_of = logsumexp(log_w, axis=(1, 2)) if f.shape[1] else np.zeros(self.p)
        weights = np.exp(log_w - log_of[:, None, None])
        odd, _, _ = _factors(np.einsum("npnp->pn", L)[:, None, :], g.T[:, None, :], A2[:, :, None])
        odd = np.where(self.known.T[:, None, :], odd, 0.0)
        log_odd = float(logsumexp(odd) - np.log(odd.size))
        which = np.unravel_index(int(np.argmax(odd)), odd.shape)
        present = self.known.any(axis=0)
        log_change = float(logsumexp(log_of[present]) - np.log(present.sum())) if present.any() else 0.0
        # at least 1, so that it is an e-value with and without odd bags
        null = max(0.0, float(np.logaddexp(np.log1p(-_ODD), np.log(_ODD) + log_odd)))
        log_of = np.where(present, log_of, -np.inf)
        return Round(
            log_change - null, log_of, log_odd, weights, size, variance, (int(which[0]), int(which[2]), A2[which[0], which[1]])
        )

    def take_odd(self, found: Round) -> int:
        """Take the likeliest odd bag as known; its index."""
        p, b, variance = found._odd
        d = np.zeros((self.n, self.p))
        d[b, p] = np.sqrt(variance)
        self._add(d.reshape(1, -1))
        return b

    def take(self, found: Round, parameter: int) -> FloatArray:
        """Take a change of a parameter as known, its time and size not: its expected course, shape (N,)."""
        w = found.weights[parameter]
        best = np.argsort(w, axis=None)[::-1][:_KEEP]
        a, k = np.unravel_index(best, w.shape)
        share = w[a, k] / w[a, k].sum()
        course = self.shapes.f[:, k] @ (share * found.size[parameter][a, k])
        d = np.zeros((len(best), self.n, self.p))
        d[:, :, parameter] = (np.sqrt(share) * self._sizes[a] * self.one_bag[parameter] * self.shapes.f[:, k]).T
        self._add(d.reshape(len(best), -1))
        return np.asarray(course)

    def _add(self, d: FloatArray) -> None:
        """Add ``d' d``, d of shape (K, N P), to the covariance."""
        d = d * self.known.reshape(-1)
        pd = self._precision @ d.T
        self._precision -= pd @ np.linalg.solve(np.eye(len(d)) + d @ pd, pd.T)


def _inverse(C: FloatArray) -> FloatArray:
    """Of a covariance, by its Cholesky factor: a third of the work of any matrix's."""
    factor, failed = lapack.dpotrf(C, lower=True)
    lower, also = lapack.dpotri(factor, lower=True)
    if failed or also:
        raise np.linalg.LinAlgError("a covariance is not positive definite")
    return np.asarray(np.tril(lower) + np.tril(lower, -1).T)


def _factors(told: FloatArray, pull: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Logarithm of the Bayes factor, mean and variance of the size."""
    more = 1.0 + variance * told
    return -0.5 * np.log(more) + 0.5 * variance * pull**2 / more, variance * pull / more, variance / more


def interval(low: FloatArray, high: FloatArray, weights: FloatArray, level: float = 0.95) -> tuple[float, float, float]:
    """Median and ends of the equal-tailed interval of a mixture of uniform distributions, ``low`` to ``high`` (K,)."""
    edges = np.unique(np.concatenate((low, high)))
    mass = np.zeros(len(edges))
    # a mixture of uniform distributions has a piecewise linear distribution function
    for k, at in enumerate(edges):
        mass[k] = weights @ np.clip((at - low) / np.maximum(high - low, 1e-9), 0.0, 1.0)
    mass /= mass[-1]
    tail = 0.5 * (1.0 - level)
    found = [float(np.interp(q, mass, edges)) for q in (0.5, tail, 1.0 - tail)]
    return found[0], found[1], found[2]
