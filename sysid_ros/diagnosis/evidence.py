"""Evidence: what speaks for a finding, and the share of the error that it makes.

All of them start from one thing, by how much a cause makes the recordings likelier: ``rise = 2 (log L_with - log L_without)``,
with the noise found anew on both sides and correlated rows counted as the few that they are. What can't be measured is None.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from math import comb
from typing import Any

import numpy as np
from scipy import special

from sysid_ros.diagnosis.fit import Block, Fit, Problem
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.term import Term
from sysid_ros.estimators.symmetric import scaled_to_one
from sysid_ros.sample import FloatArray

_95 = 1.959964
_EXACT = 10
"""Causes up to which every set of them is asked; 1024 sets cost a part of a second."""
_STD_ERROR = 0.01
"""Standard error of a share that is sampled, as a part of what all causes remove: less than the digits that are shown."""
_FEWEST_PAIRS, _MOST_PAIRS = 16, 400
_HEADLINE = 0.95
"""Part of what all causes remove that those of the headline remove."""
Removes = Callable[[frozenset[int]], float]
"""Part of the nominal model's held-out error that a set of causes removes, the others left out."""


@dataclass(frozen=True)
class Evidence:
    """What the recordings say of a cause.

    Attributes:
        rise: of the likelihood, as above. parameters: free numbers that it brings. rows: independent values that were explained.
        candidates: causes that were tried. gain: share of the held-out error, None for what has none.
    """

    rise: float
    parameters: int
    rows: float
    candidates: int
    gain: float | None = None

    @property
    def delta_bic(self) -> float:
        """As :func:`bic_difference` has it."""
        return bic_difference(self.rise, self.parameters, self.rows)

    @property
    def log10_p(self) -> float:
        """Decimal logarithm of the p-value, also where that is smaller than a number can be."""
        return log_p_value(self.rise, self.parameters, self.candidates) / float(np.log(10.0))

    @property
    def p_value(self) -> float:
        """As :func:`log_p_value` has it."""
        return float(np.exp(log_p_value(self.rise, self.parameters, self.candidates)))

    def figures(self) -> dict[str, Any]:
        """What a finding states of it."""
        return {"heldout_gain": self.gain, "delta_bic": self.delta_bic, "p_value": self.p_value, "log10_p": self.log10_p}


def together(found: Sequence[Evidence]) -> Evidence:
    """Of several independent parts of one finding."""
    gains = [e.gain for e in found if e.gain is not None]
    return Evidence(
        sum(e.rise for e in found),
        sum(e.parameters for e in found),
        sum(e.rows for e in found),
        max(e.candidates for e in found),
        sum(gains) if gains else None,
    )


def bic_difference(rise: float, parameters: int, rows: float) -> float:
    """By how much a cause lowers Schwarz' criterion: ``rise - k log(rows)``; above 10 is very strong (Kass, Raftery 1995)."""
    return rise - parameters * float(np.log(max(rows, 1.0)))


def log_p_value(rise: float, parameters: int, candidates: int = 1) -> float:
    """Natural logarithm of the probability that chance alone makes one of several candidates look so well, at most 0.

    With free numbers the rise of a cause that is none has a chi-squared distribution (Wilks 1938). Without any, as for a sign or
    an order, the bound ``exp(-rise / 2)`` of every likelihood ratio holds (Wald 1945), which is chi-squared with two degrees.
    """
    a, x = 0.5 * (parameters or 2), 0.5 * max(rise, 0.0)
    tail = float(special.gammaincc(a, x))
    if tail > 1e-290:
        log_tail = float(np.log(tail))
    else:  # the asymptotic series of the incomplete gamma function, where x is far beyond a
        series = term = 1.0
        for i in range(1, 20):
            term *= (a - i) / x
            series += term
        log_tail = (a - 1.0) * float(np.log(x)) - x - float(special.gammaln(a)) + float(np.log(series))
    return min(0.0, log_tail + float(np.log(max(candidates, 1))))


def interval(value: float, std: float) -> tuple[float, float]:
    """Ends of the 95 % interval of a value with normal errors."""
    return float(value - _95 * std), float(value + _95 * std)


def count_interval(count: int, total: int) -> tuple[float, float, float]:
    """Standard deviation and both ends of the 95 % interval of ``count / total``, exact for a Poisson count (Garwood 1936)."""
    low = float(special.gammaincinv(count, 0.025)) if count else 0.0
    high = float(special.gammaincinv(count + 1, 0.975))
    return float(np.sqrt(count)) / total, low / total, high / total


@dataclass(frozen=True, eq=False)
class Part:
    """A term in the model of every set that has all the causes ``of``, and has not the cause ``unless``."""

    term: Term
    of: frozenset[int]
    unless: int | None = None


def removed_power(problem: Problem, held: HeldOut, fit: Fit, parts: Sequence[Part], weight: FloatArray) -> Removes:
    """What each set of causes removes: its parameters are refitted to the fitted rows with the fit's noise, and judged on the
    held-out rows. Columns stay as they are in the whole fit.

    Both errors are quadratic in the parameters, so the normal equations of all terms give those of any set.

    Args:
        parts: of causes 0, 1, ...; the nuisance parameters of an inexact fit are the cause after the last.
        weight: of each joint's mean square, shape (n,) [1/(N m)^2].
    """
    terms = [part.term for part in parts]
    held.add(terms)
    judged = held.prepared.problem
    blocks, m = problem.blocks(terms, fit.inexact)
    information, score = _normal(blocks, m, 1.0 / fit.variance, problem.y)
    information[np.diag_indices(m)] += np.concatenate([*(t.prior for t in terms), problem.prior])[:m]
    samples = sum(len(motion.t) for motion in held.prepared.motions)
    blocks, _ = judged.blocks([held.terms[t] for t in terms], fit.inexact)
    power, cross = _normal(blocks, m, np.broadcast_to(weight / samples, judged.y.shape), judged.y)
    before = max(float(np.sum(held.rms(judged.y) ** 2 * weight)), 1e-12)
    own = [(p.of, p.unless) for p in parts for _ in range(p.term.p)]
    last = 1 + max((i for p in parts for i in p.of), default=-1)
    # what is considered is no cause, and would take a part of one that is more of the same
    own += [(frozenset({-1}), None)] * (problem.considered if fit.inexact else 0)
    own += [(frozenset({last}), None)] * (m - len(own))

    @cache
    def removes(causes: frozenset[int]) -> float:
        at = np.flatnonzero([of <= causes and unless not in causes for of, unless in own])
        if not len(at):
            return 0.0
        scaled, scale = scaled_to_one(information[np.ix_(at, at)])
        theta = scale * np.linalg.solve(scaled, scale * score[at])
        return float(2.0 * cross[at] @ theta - theta @ power[np.ix_(at, at)] @ theta) / before

    return removes


def shapley(removes: Removes, count: int) -> FloatArray:
    """Share of each of ``count`` causes, shape (count,): what it adds to those before it, in the mean over all orders of them.

    The shares add up to what all causes remove (Shapley 1953). One that does harm beside the others has a negative one. Beyond a
    few causes orders are drawn, each with its reverse, until the standard error is small (Castro, Gomez, Tejada 2009); the sum
    is exact all the same.
    """
    if count > _EXACT:
        return _sampled(removes, count)
    shares = np.zeros(count)
    for i in range(count):
        others = [k for k in range(count) if k != i]
        for size in range(count):
            sets = [frozenset(s) for s in combinations(others, size)]
            shares[i] += sum(removes(s | {i}) - removes(s) for s in sets) / (count * comb(count - 1, size))
    return shares


def _sampled(removes: Removes, count: int) -> FloatArray:
    rng = np.random.default_rng(0)
    total = abs(removes(frozenset(range(count))))
    found: list[FloatArray] = []
    while len(found) < _MOST_PAIRS:
        order = rng.permutation(count).tolist()
        found.append(np.mean([_along(removes, order), _along(removes, order[::-1])], axis=0))
        error = np.std(found, axis=0, ddof=1) / np.sqrt(len(found)) if len(found) >= _FEWEST_PAIRS else np.inf
        if np.all(error < _STD_ERROR * total):
            break
    return np.asarray(np.mean(found, axis=0))


def _along(removes: Removes, order: Sequence[int]) -> FloatArray:
    """What each cause adds in one order of them, shape (count,)."""
    out, known, before = np.zeros(len(order)), frozenset[int](), 0.0
    for i in order:
        known |= {i}
        after = removes(known)
        out[i], before = after - before, after
    return out


def fewest(shares: Sequence[float]) -> frozenset[int]:
    """The fewest causes whose shares make nearly all of what all causes remove; none where all together remove nothing."""
    target, bought = _HEADLINE * sum(shares), 0.0
    found: set[int] = set()
    for i in sorted(range(len(shares)), key=lambda i: -shares[i]):
        if bought >= target or shares[i] <= 0.0:
            break
        found.add(i)
        bought += shares[i]
    return frozenset(found) if target > 0.0 else frozenset()


def _normal(blocks: dict[int, Block], m: int, weight: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``sum_j X_j' W_j X_j``, shape (m, m), and ``sum_j X_j' W_j y_j``, shape (m,), of weights and rows of shape (K, n)."""
    matrix, vector = np.zeros((m, m)), np.zeros(m)
    for j, (index, X) in blocks.items():
        weighted = X * weight[:, j, None]
        matrix[np.ix_(index, index)] += weighted.T @ X
        vector[index] += weighted.T @ y[:, j]
    return matrix, vector
