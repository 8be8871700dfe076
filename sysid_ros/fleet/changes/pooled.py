"""Pooled: what robots of one kind have in common, learned from all of them (empirical Bayes).

Each parameter of each joint follows a state-space model, over bags b of robot r at days t_b::

    y_b = level(t_b) + beta_r' x_b + e_b,     e_b ~ N(0, stated variance of the bag + scatter)
    level(t_b) = level(t_b-1) + N(0, wander (t_b - t_b-1)),     level(t_0) ~ N(mean, spread)
    beta_r ~ N(beta, deviation)

x are covariates, scaled to unit variance: the temperature of the joint, or the season where no bag tells it, and the load. Mean,
spread, beta, deviation, scatter and wander are those of the kind; they are where the likelihood of all its robots, by the Kalman
filter, is greatest, beside a weak prior that holds where one or two robots tell nothing (Harvey 1989, ch. 3; Efron 2010, ch. 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.optimize import minimize

from sysid_ros.sample import FloatArray

_PRIOR = np.array([0.0, -2.0, 4.6, -2.0])
_PRIOR_STD = np.array([2.0, 2.0, 4.0, 2.0])
"""Of the logarithms of scatter / stated variance, wander in a year / (stated variance + scatter), spread / (the same), deviation
/ (the same): a factor of 7 is usual each way, and a fleet of some robots tells them all; the spread's is wide, so that a single
robot is compared with itself alone."""
_FIRST_STD = 0.5
"""Of scatter and wander in the first round, about what the median of the steps between neighbours and the prior say: a single
robot that changed is not taken for one that wanders; some robots outweigh it."""
_MEDIAN_SQUARE = 0.455
"""Of a normal variable of variance 1."""
SCATTER_PRIOR = (float(_PRIOR[0]), float(_PRIOR_STD[0]))
"""Mean and standard deviation of the logarithm of scatter / stated variance, where nothing else is known."""
_YEAR = 365.25
_DOF = 5.0
"""Of Student's distribution by which odd bags and changes that are not known yet weigh less in the first round."""


@dataclass(frozen=True, eq=False, slots=True)
class Pooled:
    """What a kind's robots share in one parameter of one joint.

    Attributes:
        mean, spread: of the level at first, and its variance between robots. scatter: variance from bag to bag beyond what is
            stated. wander: variance of the level a day. beta: by the covariates, shape (C,). deviation: variance of beta
            between robots.
    """

    mean: float
    spread: float
    scatter: float
    wander: float
    beta: FloatArray
    deviation: float


@dataclass(frozen=True, eq=False, slots=True)
class OneSeries:
    """One parameter of one joint of one robot: days (N,), estimates y (N,), stated variance (N,), covariates x (N, C)."""

    days: FloatArray
    y: FloatArray
    variance: FloatArray
    x: FloatArray


def _consistent() -> float:
    """Square of the scale of Student's distribution that is likeliest for normal innovations of variance 1: without it, all
    variances of the first round would be too small."""
    points, weights = np.polynomial.hermite_e.hermegauss(80)
    low, high = 0.1, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        u = points**2 / middle
        low, high = (middle, high) if weights @ ((_DOF + 1.0) * u / (_DOF + u)) > weights.sum() else (low, middle)
    return 0.5 * (low + high)


_SCALE = _consistent()


def pooled(series: Sequence[OneSeries], robust: bool) -> Pooled:
    """What these robots share; ``robust``: changes of theirs are not known yet."""
    known = [np.isfinite(s.y) & np.isfinite(s.variance) & (s.variance > 0.0) for s in series]
    kept = [OneSeries(s.days[k], s.y[k], s.variance[k], s.x[k]) for s, k in zip(series, known, strict=True) if k.any()]
    columns = series[0].x.shape[1]
    if not kept:
        return Pooled(0.0, np.inf, 0.0, 0.0, np.zeros(columns), 0.0)
    y = np.concatenate([s.y for s in kept])
    centre = float(np.median(y))
    stated = float(np.median(np.concatenate([s.variance for s in kept])))
    unit = np.sqrt(stated)
    start = np.cumsum([0] + [len(s.y) for s in kept])
    days, x = np.concatenate([s.days for s in kept]), np.concatenate([s.x for s in kept])
    scaled, variance = (y - centre) / unit, np.concatenate([s.variance for s in kept]) / stated
    dof = _DOF if robust else 0.0

    jumps = np.concatenate([np.diff((s.y - centre) / unit) for s in kept if len(s.y) > 1] or [np.zeros(1)])
    rough = max(0.5 * float(np.median(jumps**2)) / _MEDIAN_SQUARE - 1.0, 0.05)
    prior, width = _PRIOR.copy(), _PRIOR_STD.copy()
    if robust:
        prior[0], width[:2] = np.log(rough), _FIRST_STD

    def loss(p: FloatArray) -> float:
        value, _ = _likelihood(days, scaled, variance, x, start, _natural(p), dof)
        return float(-value + 0.5 * np.sum(((p - prior) / width) ** 2))

    first = np.array([np.log(rough), -2.0, np.log(max(float(np.var(scaled)), 1.0) / (1.0 + rough)), -2.0])
    best = minimize(loss, first, method="Nelder-Mead", options={"xatol": 0.05, "fatol": 0.02, "maxfev": 240}).x
    r, q, spread, deviation = _natural(best)
    _, fixed = _likelihood(days, scaled, variance, x, start, _natural(best), dof)
    return Pooled(centre + unit * fixed[0], stated * spread, stated * r, stated * q, unit * fixed[1:], stated * deviation)


def _natural(p: FloatArray) -> FloatArray:
    """Scatter, wander a day, spread, deviation, in units of the stated variance."""
    r = np.exp(p[0])
    return np.array([r, *np.exp(p[1:]) * (1.0 + r) / np.array([_YEAR, 1.0, 1.0])])


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _likelihood(
    days: FloatArray, y: FloatArray, variance: FloatArray, x: FloatArray, start: FloatArray, natural: FloatArray, dof: float
) -> tuple[float, FloatArray]:
    """Log likelihood where mean and beta are best, and those; ``dof``: of Student's distribution of innovations, 0 for normal."""
    c = x.shape[1]
    m, rounds = 1 + c, 3 if dof > 0.0 else 1
    weight = np.ones(y.size)
    value = 0.0
    fixed = np.zeros(m)
    z, width, e = np.zeros(y.size), np.zeros(y.size), np.zeros((y.size, m))
    h, gain, innovation = np.ones(m), np.zeros(m), np.zeros(m + 1)
    for k in range(start.size - 1):
        P = np.zeros((m, m))
        P[0, 0] = natural[2]
        for i in range(1, m):
            P[i, i] = natural[3]
        state = np.zeros((m, m + 1))  # of y, and of each column of the fixed part
        for b in range(start[k], start[k + 1]):
            if b > start[k]:
                P[0, 0] += natural[1] * (days[b] - days[b - 1])
            h[1:] = x[b]
            s = variance[b] + natural[0]
            for j in range(m + 1):
                innovation[j] = y[b] if j == 0 else h[j - 1]
            for i in range(m):
                gain[i] = 0.0
                for j in range(m):
                    gain[i] += P[i, j] * h[j]
                s += h[i] * gain[i]
                for j in range(m + 1):
                    innovation[j] -= h[i] * state[i, j]
            width[b], z[b], e[b] = s, innovation[0], innovation[1:]
            for i in range(m):
                for j in range(m + 1):
                    state[i, j] += gain[i] * innovation[j] / s
            for i in range(m):
                for j in range(m):
                    P[i, j] -= gain[i] * gain[j] / s
    for _ in range(rounds):
        A, g = 1e-9 * np.eye(m), np.zeros(m)
        for b in range(y.size):
            w = weight[b] / width[b]
            for i in range(m):
                g[i] += w * e[b, i] * z[b]
                for j in range(m):
                    A[i, j] += w * e[b, i] * e[b, j]
        fixed = np.linalg.solve(A, g)
        value = 0.0
        for b in range(y.size):
            left = z[b]
            for i in range(m):
                left -= e[b, i] * fixed[i]
            square = left * left / width[b]
            if dof > 0.0:
                square /= _SCALE
                weight[b] = (dof + 1.0) / (dof + square)
                value -= 0.5 * np.log(width[b]) + 0.5 * (dof + 1.0) * np.log(1.0 + square / dof)
            else:
                value -= 0.5 * np.log(width[b]) + 0.5 * square
    return value, fixed
