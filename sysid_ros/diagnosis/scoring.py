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


@dataclass(frozen=True, eq=False)
class Proposal:
    """Terms that would be added at once, of one effect or one on each joint, and the likelihood less its price that they gain."""

    terms: tuple[Term, ...]
    score: float
    fit: Fit

    @property
    def words(self) -> str:
        """What is proposed."""
        names = self.terms[0].effect.robot.joint_names
        on: dict[str, list[str]] = {}
        for t in self.terms:
            on.setdefault(t.effect.label, []).append(names[t.joints[0]])
        return "; ".join(f"{label} on {', '.join(joints)}" for label, joints in on.items())


class Scorer:
    """Scores terms against one fit.

    With the noise of the fit the whitened residual has a sum of squares RSS_j near K in each joint; a term that takes D_j of it
    would gain ``sum_j K / 2 log(RSS_j / (RSS_j - D_j))`` once the noise is found anew.
    """

    def __init__(self, problem: Problem, fit: Fit) -> None:
        self._fit = fit
        self._active, self._prior = problem.active, problem.prior
        self._root = 1.0 / np.sqrt(fit.variance)
        self._residual = fit.residual * self._root
        self._rss = np.maximum(np.sum(self._residual**2, axis=0), 1e-9)
        self._count = len(problem.y)

    def local(self, terms: Sequence[Term]) -> list[Score]:
        """Scores of terms that load one and the same joint."""
        j = terms[0].row
        assert j is not None
        if j not in self._active:
            return []
        index, X = self._fit.blocks[j]
        C = np.concatenate([t.columns for t in terms], axis=1) * self._root[:, j, None]
        B = (X * self._root[:, j, None]).T @ C
        GB = self._fit.inverse[np.ix_(index, index)] @ B
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

    def _given_back(self, change: FloatArray) -> float:
        """Likelihood that the nuisance parameters gain where a term takes over what they had to explain."""
        if not self._fit.inexact:
            return 0.0
        before = self._fit.theta[-len(self._prior) :]
        after = before - change[-len(self._prior) :]
        return 0.5 * float(np.sum(self._prior * (before**2 - after**2)))

    def whole(self, term: Term) -> Score:
        """Score of a term that loads several joints."""
        active, p = self._active, term.p
        B, own, score = np.zeros((len(self._fit.theta), p)), np.zeros((p, p)), np.zeros(p)
        whitened = {int(j): term.columns[:, j] * self._root[:, j, None] for j in active}
        for j, C in whitened.items():
            index, X = self._fit.blocks[j]
            B[index] += (X * self._root[:, j, None]).T @ C
            own += C.T @ C
            score += C.T @ self._residual[:, j]
        GB = self._fit.inverse @ B
        theta, _, std = _solve(own - B.T @ GB, score, np.diag(own))
        change = GB @ theta
        rss = np.empty(len(active))
        for i, (j, C) in enumerate(whitened.items()):
            index, X = self._fit.blocks[j]
            left = self._residual[:, j] - C @ theta + (X @ change[index]) * self._root[:, j]
            rss[i] = max(float(left @ left), 1e-9)
        gain = 0.5 * self._count * float(np.sum(np.log(self._rss[active] / rss))) + self._given_back(change)
        return Score(term, gain, theta, std)


def _solve(information: FloatArray, score: FloatArray, own: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Parameters, drop of the sum of squares and standard deviations; directions that the fit has already are left at zero."""
    scale = 1.0 / np.sqrt(np.maximum(own, 1e-30))
    values, vectors = np.linalg.eigh(information * scale[:, None] * scale)
    keep = values > 1e-9
    inverse = (vectors[:, keep] / values[keep]) @ vectors[:, keep].T * scale[:, None] * scale
    theta = inverse @ score
    return theta, float(score @ theta), np.sqrt(np.maximum(np.diag(inverse), 0.0))
