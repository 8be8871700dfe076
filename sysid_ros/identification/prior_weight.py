"""How strongly each link is held to the URDF's, chosen by the error on data that were not fitted."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray

WEIGHTS = (0.01, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6, math.inf)
"""Weights of the prior worth trying for all links alike; at ``inf`` the links are the URDF's and only the rest is free."""

_OF_ONE_LINK = (1e4, 100.0, 1.0)
"""Weights worth trying for a single link."""

_GAIN = 0.02
"""Least gain for which a link is set free: mean over the joints of the logarithm of the squared error."""

_GUARDS = ((0.01, 0.005, 0.0), (0.03, 0.01, 0.2), (0.06, 0.015, 0.4), (0.12, 0.02, 0.6))
"""Parts by which a joint's error may exceed that of the URDF's links, in any single split of the data and over all of them, and
the gain for which so much is allowed: a joint that no inertials improve, and whose friction was not the same all the time, must
not keep all the others from theirs."""


@dataclass(frozen=True, slots=True)
class WeightChoice:
    """Weights of the prior and why.

    Attributes:
        weights: chosen, one a link, shape (k,). ratio: of the held-out error with them to that with the URDF's links, in the
            geometric mean over the joints. common: the same ratio where all links have one weight, for each of ``WEIGHTS``.
    """

    weights: FloatArray
    ratio: float
    common: FloatArray


def choose_weights(held_out: Callable[[FloatArray], FloatArray], links: int) -> WeightChoice:
    """The largest weights with which the data that were not fitted are predicted as well as the best, and on no joint worse than
    with the URDF's own links.

    A search from the URDF's links: one weight for all is taken if it brings a gain, then the link that gains most is set free,
    as long as one does; last, each link is held as firmly as costs nothing. So a link that the data can't improve keeps the
    URDF's inertials.

    Args:
        held_out: mean squared residual of every joint in every split of the data, shape (s, n) [(N m)^2], for weights of the
            links, shape (k,). links: k.

    Raises:
        DataError: an error is not finite.
    """
    search = _Search(held_out, links)
    common = np.array([math.exp(0.5 * search.score(np.full(links, w))) for w in WEIGHTS])
    best, score = np.full(links, math.inf), 0.0
    for single, pooled, worth in _GUARDS:
        weights, reached = search.run(single, pooled)
        if reached < score - worth:
            best, score = weights, reached
    return WeightChoice(best, math.exp(0.5 * score), common)


class _Search:
    """Errors by weights, each worked out once."""

    def __init__(self, held_out: Callable[[FloatArray], FloatArray], links: int) -> None:
        self._held_out, self._links = held_out, links
        self._known: dict[tuple[float, ...], tuple[float, float, float]] = {}
        self._urdf = np.maximum(held_out(np.full(links, math.inf)), 1e-300)

    def _compare(self, weights: FloatArray) -> tuple[float, float, float]:
        """Mean logarithm of the pooled ratios of squared errors, the largest of them, and the largest in a single split."""
        key = tuple(weights.tolist())
        if key not in self._known:
            errors = np.maximum(self._held_out(weights), 1e-300)
            if not np.isfinite(errors).all():
                raise DataError("the error on held-out data is not finite; a recording holds NaN or infinite values.")
            pooled = errors.mean(axis=0) / self._urdf.mean(axis=0)
            self._known[key] = float(np.mean(np.log(pooled))), float(pooled.max()), float((errors / self._urdf).max())
        return self._known[key]

    def score(self, weights: FloatArray) -> float:
        return self._compare(weights)[0]

    def run(self, single: float, pooled: float) -> tuple[FloatArray, float]:
        """The best weights within a guard, and their score."""

        def allowed(weights: FloatArray) -> bool:
            _, worst, worst_single = self._compare(weights)
            return worst <= (1.0 + pooled) ** 2 and worst_single <= (1.0 + single) ** 2

        weights, score = np.full(self._links, math.inf), 0.0
        alike = [np.full(self._links, w) for w in WEIGHTS]
        if good := [w for w in alike if allowed(w)]:
            least = min(map(self.score, good))
            firmest = [w for w in good if self.score(w) <= least + _GAIN][-1]
            if self.score(firmest) < -_GAIN:
                weights, score = firmest, self.score(firmest)
        for _ in range(len(_OF_ONE_LINK) * self._links):
            freer = [
                changed
                for k in range(self._links)
                for w in _OF_ONE_LINK
                if w < weights[k] and allowed(changed := _with(weights, k, w))
            ]
            if not freer or self.score(best := min(freer, key=self.score)) > score - _GAIN:
                break
            weights, score = best, self.score(best)
        for k in reversed(range(self._links)):
            for w in (math.inf, *_OF_ONE_LINK):
                if w > weights[k] and allowed(firmer := _with(weights, k, w)) and self.score(firmer) <= score + 0.5 * _GAIN:
                    weights, score = firmer, max(score, self.score(firmer))
                    break
        return weights, score


def _with(weights: FloatArray, k: int, weight: float) -> FloatArray:
    changed = weights.copy()
    changed[k] = weight
    return changed
