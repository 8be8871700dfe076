"""Candidates: a change that may be there, told from its posterior; how sudden changes are is learned from all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.fleet.changes.carried import CarriedEvidence
from sysid_ros.fleet.changes.evidence import Round, Shapes, interval
from sysid_ros.fleet.changes.quantities import CARRIED
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class Candidate:
    """A change that may be there.

    Attributes:
        joint: "" for what is carried. quantity: of ``QUANTITIES``. log_e: logarithm of the e-value that anything changed.
        kinds: probability of each quantity, given that something changed. since: median and ends of its 95 % interval [days].
        sudden: probability that it came at once. length: how long it took, mean of the posterior [days]. size, std: by the last
            bag [SI].
    """

    robot: str
    joint: str
    quantity: str
    log_e: float
    kinds: dict[str, float]
    since: tuple[float, float, float]
    sudden: float
    length: float
    size: float
    std: float


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """A change before it is dated: weights (K,) of its shapes with half of the prior on sudden ones, and what each says."""

    robot: str
    joint: str
    quantity: str
    log_e: float
    kinds: dict[str, float]
    begin: FloatArray
    end: FloatArray
    length: FloatArray
    weights: FloatArray
    size: FloatArray
    square: FloatArray


def found_in(robot: str, joint: str, look: Round, best: int, kinds: dict[str, float], courses: Shapes) -> Found:
    """The change of a joint that a look found in its parameter of index ``best``."""
    # a ramp that goes on is told by what there is of it at the last bag
    there = courses.f[-1]
    w, size, variance = look.weights[best], look.size[best] * there, look.size_variance[best] * there**2
    whole = w.sum(axis=0)
    part = np.where(whole > 0.0, whole, 1.0)
    mean = np.sum(w * size, axis=0) / part
    square = np.sum(w * (variance + size**2), axis=0) / part
    name = list(kinds)[best]
    return Found(robot, joint, name, look.log_e, kinds, courses.begin, courses.end, courses.length, whole, mean, square)


def found_carried(robot: str, evidence: CarriedEvidence) -> Found:
    """The change of what a robot carries always; it comes at once."""
    k = len(evidence.weights)
    square = np.full(k, evidence.delta**2 + evidence.std**2)
    at_once = (evidence.before, evidence.after, np.zeros(k), evidence.weights, np.full(k, evidence.delta), square)
    return Found(robot, "", CARRIED, evidence.log_e, {CARRIED: 1.0}, *at_once)


def candidates_of(found: Sequence[Found]) -> list[Candidate]:
    """Each change with its date and size. How many changes of a quantity come at once is learned from all of its changes in the
    fleet, beside one of either kind that was not seen (a beta prior)."""
    share = {f.quantity: 0.5 for f in found}
    for _ in range(30):
        sudden = {q: [_sudden(f, share[q]) for f in found if f.quantity == q] for q in share}
        share = {q: (1.0 + sum(of)) / (2.0 + len(of)) for q, of in sudden.items()}
    return [_candidate(f, _reweighted(f, share[f.quantity])) for f in found]


def _reweighted(found: Found, share: float) -> FloatArray:
    if not np.any(found.length > 0.0):
        return found.weights
    w = found.weights * np.where(found.length > 0.0, 1.0 - share, share)
    return np.asarray(w / w.sum())


def _sudden(found: Found, share: float) -> float:
    return float(_reweighted(found, share)[found.length == 0.0].sum())


def _candidate(found: Found, w: FloatArray) -> Candidate:
    size = float(w @ found.size)
    std = float(np.sqrt(max(float(w @ found.square) - size**2, 0.0)))
    return Candidate(
        found.robot,
        found.joint,
        found.quantity,
        found.log_e,
        found.kinds,
        interval(found.begin, found.end, w),
        float(w[found.length == 0.0].sum()),
        float(w @ found.length),
        size,
        std,
    )
