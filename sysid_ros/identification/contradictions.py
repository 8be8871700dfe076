"""Bags that no single model explains: another tool in one of them, another scale or sign of the effort, another robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import DataError
from sysid_ros.identification.bag_sums import BagSums
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.result import Problem
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray

_OWN_ITERATIONS = 5


def check_contradictions(
    bags: Sequence[BagRows], found: Fit, prior: Prior, joint_names: Sequence[str], accept: bool = False
) -> list[Problem]:
    """Compare the residual of the common fit with that of each bag's own fit.

    Args:
        bags: at least one; with one there is nothing to compare. accept: say it and go on.

    Raises:
        DataError: naming the bags, the joints and the residuals.
    """
    if len(bags) < 2:
        return []
    sums = found.sums
    own, torque = _own(sums, prior), np.sqrt(sums.power / np.maximum(sums.count, 1.0))
    against = _against(sums, found.theta, own, torque)
    if not against.any():
        return []
    odd = _odd_one_out(sums, found, prior, own, torque) if len(bags) > 2 else None
    pooled = _rms(sums, found.theta)
    worst = int(np.argmax(np.where(against, pooled / own, 0.0).max(axis=1)))
    joints = ", ".join(
        f"{joint_names[j]} {pooled[worst, j]:.2g} N m ({own[worst, j]:.2g} by a model of its own)"
        for j in np.flatnonzero(against[worst]).tolist()
    )
    names = [bag.name for bag in bags]
    which = f"{names[odd]} contradicts the others" if odd is not None else f"{' and '.join(names)} contradict each other"
    text = (
        f"{which}: one model for all leaves in {names[worst]} a residual of {joints}. The arm carried something else, or the "
        "effort was in another scale or sign. Identify with bags in which it carries the same, or with each bag by itself"
    )
    loud = against & (pooled > TOL.contradicts_alone * own)
    if (loud.any() or (against.sum(axis=1) > 1).any()) and not accept:
        raise DataError(f"{text}; --accept-doubts goes on regardless.")
    return [Problem("" if odd is None else names[odd], "", "bags_contradict", f"{text[0].upper()}{text[1:]}.")]


def _rms(sums: BagSums, theta: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(sums.squares(theta) / np.maximum(sums.count, 1.0)))


def _own(sums: BagSums, prior: Prior) -> FloatArray:
    """rms of the residual of each bag's own fit, weighted by its own noise, shape (B, n) [N m].

    The weights of the common fit won't do: a joint that does not fit the other bags hardly weighs in it.
    """
    precision = prior.precision()
    out = []
    for b in range(len(sums.count)):
        bag = sums.only([b])
        residual = np.sqrt(bag.power / np.maximum(bag.count, 1.0))
        for _ in range(_OWN_ITERATIONS):
            weight = 1.0 / (TOL.rows_as_one * np.maximum(residual, 1e-9) ** 2)
            A = bag.information(weight) + np.diag(precision)
            side = bag.right_side(weight) + precision * prior.mean
            theta = np.asarray(np.linalg.solve(A, side), dtype=np.float64)
            residual = _rms(bag, theta)
        out.append(residual[0])
    return np.asarray(np.maximum(np.array(out), 1e-9))


def _against(sums: BagSums, theta: FloatArray, own: FloatArray, torque: FloatArray) -> NDArray[np.bool_]:
    pooled = _rms(sums, theta)
    enough = sums.count > sums.score.shape[2]  # a fit follows fewer rows than it has parameters
    return np.asarray(enough & (pooled > TOL.contradicts * own) & (pooled > TOL.contradicts_part * torque))


def _odd_one_out(sums: BagSums, found: Fit, prior: Prior, own: FloatArray, torque: FloatArray) -> int | None:
    """The bag without which the others agree; None where there is none."""
    precision = prior.precision()
    for b in range(len(found.weight)):
        rest = [k for k in range(len(found.weight)) if k != b]
        information, score = found.bag_information[rest].sum(axis=0), found.bag_score[rest].sum(axis=0)
        theta = np.linalg.solve(information + np.diag(precision), score + precision * prior.mean)
        if not _against(sums.only(rest), theta, own[rest], torque[rest]).any():
            return b
    return None
