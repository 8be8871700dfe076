"""Bags that no single model explains: another tool in one of them, another scale or sign of the effort, another robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import DataError
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.normal_equations import NormalEquations
from sysid_ros.identification.result import Problem
from sysid_ros.identification.rows import BagRows
from sysid_ros.sample import FloatArray

_TIMES, _PART = 2.0, 0.08
_TIMES_ALONE, _PART_ALONE = 3.0, 0.10
"""A joint speaks against a bag where the common model leaves so many times the residual of the bag's own model, and so much of
the torque. Friction that has warmed up stays below; one joint alone must speak louder."""

_OWN_ITERATIONS = 5
_COLOURED = 4.0
"""Rows that count as one where only the size of the residual is known."""


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
    equations = found.equations
    own, torque = _own(equations, prior), np.sqrt(equations.power / np.maximum(equations.count, 1.0))
    against = _against(equations, found.theta, own, torque)
    if not against.any():
        return []
    odd = _odd_one_out(equations, found, prior, own, torque) if len(bags) > 2 else None
    pooled = _rms(equations, found.theta)
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
    loud = against & (pooled > _TIMES_ALONE * own) & (pooled > _PART_ALONE * torque)
    if (loud.any() or (against.sum(axis=1) > 1).any()) and not accept:
        raise DataError(f"{text}; --accept-doubts goes on regardless.")
    return [Problem("" if odd is None else names[odd], "", "bags_contradict", f"{text[0].upper()}{text[1:]}.")]


def _rms(equations: NormalEquations, theta: FloatArray) -> FloatArray:
    root: FloatArray = np.sqrt(equations.squares(theta) / np.maximum(equations.count, 1.0))
    return root


def _own(equations: NormalEquations, prior: Prior) -> FloatArray:
    """rms of the residual of each bag's own fit, weighted by its own noise, shape (B, n) [N m].

    The weights of the common fit won't do: a joint that does not fit the other bags hardly weighs in it.
    """
    precision = prior.precision()
    out = []
    for b in range(len(equations.count)):
        bag = equations.only([b])
        residual = np.sqrt(bag.power / np.maximum(bag.count, 1.0))
        for _ in range(_OWN_ITERATIONS):
            weight = 1.0 / (_COLOURED * np.maximum(residual, 1e-9) ** 2)
            A = bag.information(weight) + np.diag(precision)
            side = bag.right_side(weight) + precision * prior.mean
            theta = np.asarray(np.linalg.solve(A, side), dtype=np.float64)
            residual = _rms(bag, theta)
        out.append(residual[0])
    own: FloatArray = np.maximum(np.array(out), 1e-9)
    return own


def _against(equations: NormalEquations, theta: FloatArray, own: FloatArray, torque: FloatArray) -> NDArray[np.bool_]:
    pooled = _rms(equations, theta)
    enough = equations.count > 50.0
    return np.asarray(enough & (pooled > _TIMES * own) & (pooled > _PART * torque))


def _odd_one_out(equations: NormalEquations, found: Fit, prior: Prior, own: FloatArray, torque: FloatArray) -> int | None:
    """The bag without which the others agree; None where there is none."""
    precision = prior.precision()
    for b in range(len(found.weight)):
        rest = [k for k in range(len(found.weight)) if k != b]
        information, score = found.bag_information[rest].sum(axis=0), found.bag_score[rest].sum(axis=0)
        theta = np.linalg.solve(information + np.diag(precision), score + precision * prior.mean)
        if not _against(equations.only(rest), theta, own[rest], torque[rest]).any():
            return b
    return None
