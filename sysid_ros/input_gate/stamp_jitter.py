"""Stamps that jitter: what a sample that was taken a little before or after its stamp does to all joints at once.

A stamp that is off by d puts a position off the smooth motion by v d on every joint, with one d for all of them; noise of the
encoders has no such pattern. So the positions themselves tell the stamps' errors from the encoders' noise, where two joints or
more move. With the stencil D of the cubic through two neighbours on each side, ``D q = D (V d + e)``, ``d ~ N(0, sigma^2)``,
``e_j ~ N(0, s_j^2)``: a factor analysis whose loadings, the velocities, are known. Its likelihood gives the levels (by
expectation maximisation; Rubin, Thayer 1982), and d follows as the mean of its posterior, from one banded system. Where the
motion itself bends within a step, all joints start or stop at once and look the same: what a change of the velocity between more
distant neighbours may leave there is a level of noise beside the positions' own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sysid_ros.input_gate.neighbours import applied, slopes, stencil, without_gaps
from sysid_ros.sample import FloatArray

_FEWEST = 100
"""Samples that levels are found from."""
_MOST = 40_000
"""Samples that are enough to find them from."""
_ITERATIONS, _CONVERGED = 100, 1e-3
"""Most steps of the expectation maximisation, and the log-likelihood of all samples that a last one gains."""
_LINEARISED = 2
"""How often the velocities are taken anew at the corrected stamps."""
_BEND = 1.0 / 3.0
"""Largest difference from the cubic through its neighbours that a bend makes, over its change of velocity times a step."""
_FAR = 6
"""Neighbours whose velocities tell a bend."""
_FINEST = 1e-15
"""Least level of the positions' noise: below it numbers have no digits."""


@dataclass(frozen=True, eq=False)
class StampJitter:
    """Errors of stamps.

    Attributes:
        std: of the errors [s]. noise: of the positions beside them, shape (n,). gain: log-likelihood that they have over exact
            stamps, less what their level costs, ``log(N) / 2``.
        errors: what is to be added to each stamp, shape (N,) [s].
    """

    std: float
    noise: FloatArray
    gain: float
    errors: FloatArray


def stamp_jitter(t: FloatArray, q: FloatArray) -> StampJitter | None:
    """Errors of the stamps of a recording; None where exact stamps are likelier, nothing tells, or errors would turn the order of
    two stamps: such ones are none that a level describes.

    Args:
        t: stamps, rising, shape (N,) [s]. q: positions, shape (N, n).
    """
    if q.shape[1] < 2 or len(t) < _FEWEST:
        return None
    weights, usable, velocity = stencil(t), without_gaps(t), slopes(t, q)
    weight = np.sum(weights**2, axis=1)
    off = applied(weights, q) / np.sqrt(weight)[:, None]
    rows = np.flatnonzero(usable)
    some = rows[:: max(1, len(rows) // _MOST)]
    moves = np.any(off[some] != 0.0, axis=0)
    if np.sum(moves) < 2 or len(some) < _FEWEST:
        return None
    bends = _bends(t, q)
    given = off[some][:, moves], velocity[some][:, moves], bends[some][:, moves]
    *_, exact = _levels(*given, jitters=False)
    std, noise, bend, likelihood = _levels(*given, jitters=True)
    gain = (likelihood - exact) * len(rows) / len(some) - 0.5 * float(np.log(len(rows)))
    if gain <= 0.0:
        return None
    precision = (usable / weight)[:, None] / (noise**2 + (bend * bends[:, moves]) ** 2)
    errors = np.zeros(len(t))
    for _ in range(_LINEARISED):
        errors = _errors(t, errors, q[:, moves], precision, std)
        if np.any(np.diff(t + errors) <= 0.0):
            return None
    every = np.zeros(q.shape[1])
    every[moves] = noise
    return StampJitter(std, every, gain, errors)


def _levels(off: FloatArray, velocity: FloatArray, bends: FloatArray, jitters: bool) -> tuple[float, FloatArray, float, float]:
    """Likeliest levels of the stamps' errors, of the positions' and of the bends, and the log-likelihood.

    Args:
        off: differences from neighbours with a variance of one each, shape (N, n). velocity, bends: shape (N, n). jitters: False
            for stamps without errors.
    """
    s2, b2 = 0.5 * np.mean(off**2, axis=0) + _FINEST**2, 0.5 * _BEND**2
    t2 = float(np.mean(off**2) / max(float(np.mean(velocity**2)), 1e-300)) if jitters else 0.0
    before = -np.inf
    for _ in range(_ITERATIONS):
        precision = 1.0 / (s2 + b2 * bends**2)
        along = np.sum(off * velocity * precision, axis=1)
        whole = 1.0 + t2 * np.sum(velocity**2 * precision, axis=1)
        mean, variance = t2 * along / whole, t2 / whole
        quadratic = np.sum(off**2 * precision, axis=1) - along * mean
        likelihood = -0.5 * float(np.sum(np.log(whole) + quadratic)) + 0.5 * float(np.sum(np.log(precision)))
        if likelihood - before < _CONVERGED:
            break
        before = likelihood
        t2 = float(np.mean(mean**2 + variance))
        ratio = precision * ((off - velocity * mean[:, None]) ** 2 + velocity**2 * variance[:, None])
        s2 = s2 * np.sum(precision * ratio, axis=0) / np.sum(precision, axis=0) + _FINEST**2
        weight = bends**2 * precision
        b2 = min(b2 * float(np.sum(weight * ratio)) / max(float(np.sum(weight)), 1e-300), _BEND**2)
    return float(np.sqrt(t2)), np.sqrt(s2), float(np.sqrt(b2)), before


def _bends(t: FloatArray, q: FloatArray) -> FloatArray:
    """Change of the velocity from some neighbours before a sample to as many after it, times a step, shape (N - 4, n)."""
    last = len(t) - 1
    at = np.arange(2, len(t) - 2)
    near, far = (np.clip(at[:, None] + np.array([-d, d]), 0, last) for d in (2, _FAR))
    step = np.abs(t[far] - t[near])
    step[step == 0.0] = np.inf
    speed = (q[far] - q[near]) / (np.array([-1.0, 1.0]) * step)[:, :, None]
    period = (t[4:] - t[:-4]) / 4.0
    return np.asarray((speed[:, 1] - speed[:, 0]) * period[:, None])


def _errors(t: FloatArray, errors: FloatArray, q: FloatArray, precision: FloatArray, std: float) -> FloatArray:
    """Mean of the posterior of the stamps' errors, linear about some that are near, shape (N,) [s].

    Args:
        precision: of what the stencil leaves of the positions, shape (N - 4, n).
    """
    weights = stencil(t + errors)
    velocity, off = np.gradient(q, t + errors, axis=0), applied(weights, q)
    count, width = weights.shape
    band, right = np.zeros((width, len(q))), np.zeros(len(q))
    for j in range(q.shape[1]):
        own = [weights[:, i] * velocity[i : i + count, j] for i in range(width)]
        seen = (off[:, j] + sum(own[i] * errors[i : i + count] for i in range(width))) * precision[:, j]
        for i in range(width):
            right[i : i + count] += own[i] * seen
            for k in range(i, width):
                band[width - 1 - (k - i), k : k + count] += own[i] * own[k] * precision[:, j]
    band[-1] += 1.0 / std**2
    return np.asarray(linalg.solveh_banded(band, right))
