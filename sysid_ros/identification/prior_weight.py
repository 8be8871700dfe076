"""The weight of a prior, chosen by the error on data that were not fitted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray

WEIGHTS = (0.01, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6, math.inf)
"""Weights of the prior worth trying; at ``inf`` the links are the URDF's and only the other effects are free."""


@dataclass(frozen=True, slots=True)
class WeightChoice:
    """The weight of the prior and why.

    Attributes:
        weight: chosen. weights: tried, ascending, shape (w,). errors: held-out rms of every joint at each, shape (w, n) [N m].
    """

    weight: float
    weights: FloatArray
    errors: FloatArray


def choose_weight(
    held_out: Callable[[float], FloatArray], weights: Sequence[float] = WEIGHTS, slack: float = 0.02
) -> WeightChoice:
    """The largest weight whose error on data that were not fitted is as good as the best.

    The error of a weight is the mean over the joints of the squared ratio to that joint's least. A weight with which a joint
    comes out worse than with the URDF's own links (weight ``inf``, where it is among ``weights``) is not taken.

    Args:
        held_out: rms of the held-out residual of every joint at a weight, shape (n,) [N m]. weights: to try.
        slack: part by which the error may exceed the best, for more prior: a few dozen independent rows know it no better.

    Raises:
        DataError: an error is not finite.
    """
    tried = np.array(sorted(weights))
    errors = np.array([held_out(float(w)) for w in tried])
    if not np.isfinite(errors).all():
        raise DataError("the error on held-out data is not finite; a recording holds NaN or infinite values.")
    least = np.maximum(errors.min(axis=0), 1e-300)
    score = np.mean((errors / least) ** 2, axis=1)
    allowed = np.ones(len(tried), dtype=bool)
    if math.isinf(tried[-1]):
        allowed = np.all(errors <= (1.0 + slack) * errors[-1], axis=1)
    good = allowed & (score <= (1.0 + slack) ** 2 * score[allowed].min())
    return WeightChoice(float(tried[np.flatnonzero(good)[-1]]), tried, errors)
