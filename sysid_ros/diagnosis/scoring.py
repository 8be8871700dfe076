"""What a term would gain, from the score of the present fit: fast enough to try every candidate at each step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, eq=False)
class Score:
    """A term with the likelihood that it would gain and the parameters that it would have, all others adjusted."""

    term: Term
    gain: float
    theta: FloatArray
    std: FloatArray


class Scorer:
    """Scores terms against one fit.

    With the noise of the fit the whitened residual has a sum of squares RSS_j near K in each joint; a term that takes D_j of it
    would gain ``sum_j K / 2 log(RSS_j / (RSS_j - D_j))`` once the noise is found anew.
    """

    def __init__(self, problem: Problem, fit: Fit) -> None:
        self._fit = fit
        K, n = problem.y.shape
        self._active = problem.active
        self._root = 1.0 / np.sqrt(fit.variance)
        self._residual = fit.residual * self._root
        self._X = fit.whitened
        self._rss = np.maximum(np.sum(self._residual**2, axis=0), 1e-9)
        self._count = K

    def local(self, terms: Sequence[Term]) -> list[Score]:
        """Scores of terms that load one and the same joint."""
        j = terms[0].row
        assert j is not None
        if j not in self._active:
            return []
        X = self._X[:, j]
        C = np.concatenate([t.columns for t in terms], axis=1) * self._root[:, j, None]
        B = X.T @ C
        GB = self._fit.inverse @ B
        g = C.T @ self._residual[:, j]
        out, start = [], 0
        for term in terms:
            s = slice(start, start + term.p)
            start += term.p
            own = C[:, s].T @ C[:, s]
            theta, drop, std = _solve(own - B[:, s].T @ GB[:, s], g[s], np.diag(own))
            left = max(self._rss[j] - drop, 1e-9 * self._rss[j])
            out.append(Score(term, 0.5 * self._count * float(np.log(self._rss[j] / left)), theta, std))
        return out

    def whole(self, term: Term) -> Score:
        """Score of a term that loads several joints."""
        active = self._active
        C = (term.columns * self._root[:, :, None])[:, active].reshape(-1, term.p)
        X = self._X[:, active].reshape(self._count * len(active), self._X.shape[2])
        r = self._residual[:, active].ravel()
        B = X.T @ C
        GB = self._fit.inverse @ B
        own = C.T @ C
        theta, _, std = _solve(own - B.T @ GB, C.T @ r, np.diag(own))
        left = (r - C @ theta + X @ (GB @ theta)).reshape(-1, len(active))
        rss = np.maximum(np.sum(left**2, axis=0), 1e-9)
        gain = 0.5 * self._count * float(np.sum(np.log(self._rss[active] / rss)))
        return Score(term, gain, theta, std)


def _solve(information: FloatArray, score: FloatArray, own: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Parameters, drop of the sum of squares and standard deviations; directions that the fit has already are left at zero."""
    scale = 1.0 / np.sqrt(np.maximum(own, 1e-30))
    values, vectors = np.linalg.eigh(information * scale[:, None] * scale)
    keep = values > 1e-7
    inverse = (vectors[:, keep] / values[keep]) @ vectors[:, keep].T * scale[:, None] * scale
    theta = inverse @ score
    return theta, float(score @ theta), np.sqrt(np.maximum(np.diag(inverse), 0.0))
