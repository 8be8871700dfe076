"""One set of terms with links that are more or less inexact: what the scale does not change is eliminated once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.diagnosis.left_out import LeftOut, block
from sysid_ros.diagnosis.sets.prediction_spread import Spread, held_out_rows
from sysid_ros.diagnosis.sets.stretches import Indices
from sysid_ros.estimators.symmetric import inverse_of
from sysid_ros.sample import FloatArray


def occam_factor(covariance: FloatArray, prior: FloatArray) -> float:
    """What it costs that so inexact links could have had other torques, less what their parameters cost the predictions already.

    Args:
        covariance: of these parameters without each fitted stretch, shape (S, c, c).
        prior: their inverse variances before, shape (c,).
    """
    part = np.mean(covariance, axis=0) * prior
    return -0.5 * float(np.linalg.slogdet(part)[1]) - (len(prior) - float(np.trace(part)))


class LinkScales:
    """Likelihoods of one set with the parameters of its links as uncertain as each of several priors says.

    Between priors only some parameters differ. Their information with all others eliminated (Schur complement) is the same for
    every prior, so that a prior costs the inverse of those few.

    Args:
        left_out: the rows. at: columns of the set, shape (a,). priors: inverse variances of their parameters before any data,
            shape (k, a), one row for each scale.
    """

    def __init__(self, left_out: LeftOut, at: Indices, priors: FloatArray) -> None:
        self._left_out, self._at, self._priors = left_out, at, priors
        links = np.isin(at, left_out.of_each.inexact)
        self._free = np.flatnonzero(links | (np.ptp(priors, axis=0) > 0.0))
        self._links = np.flatnonzero(links[self._free])
        self._fixed = np.delete(np.arange(len(at)), self._free)
        M, score = left_out.equations(at)
        M[:, self._fixed, self._fixed] += priors[0, self._fixed]
        inverse, cross = inverse_of(block(M, self._fixed, self._fixed)), block(M, self._fixed, self._free)
        self._taken = inverse @ cross
        self._alone = (inverse @ score[:, self._fixed, None])[:, :, 0]
        self._rest = block(M, self._free, self._free) - cross.swapaxes(1, 2) @ self._taken
        self._score = score[:, self._free] - (score[:, None, self._fixed] @ self._taken)[:, 0]
        self._held_out = {j: self._held_out_of(j, inverse) for j in left_out.of_each.held_out_x}

    def of(self, which: Sequence[int]) -> tuple[FloatArray, list[float]]:
        """Likelihood of each stretch with some of the priors, shape (k, S), and :func:`occam_factor` of the links with each."""
        priors, diagonal = self._priors[list(which)], np.arange(len(self._free))
        M = np.repeat(self._rest[None], len(priors), axis=0)
        M[:, :, diagonal, diagonal] += priors[:, None, self._free]
        covariance = inverse_of(M)
        free = (covariance @ self._score[:, :, None])[..., 0]
        thetas = np.empty((*free.shape[:2], len(self._at)))
        thetas[:, :, self._free] = free
        thetas[:, :, self._fixed] = self._alone - (self._taken @ free[..., None])[..., 0]
        held_out, told = self._held_out.items(), covariance[:, None, self._left_out.of_each.predicting]
        spread: Spread = {j: K + X.swapaxes(1, 2) @ (told @ X) for j, (K, X) in held_out}
        links, without = self._links, covariance[:, self._left_out.of_each.fitted]
        parts = zip(without[:, :, links[:, None], links], priors[:, self._free[links]], strict=True)
        return self._left_out.likelihood(self._at, priors, thetas, spread), [occam_factor(c, p) for c, p in parts]

    def _held_out_of(self, joint: int, inverse: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The spread of a joint's held-out rows with exact links, shape (H, L, L), and the columns of what differs, less what the
        others follow of them, shape (H, f, L)."""
        first = self._left_out.of_each.predicting
        X, loads = held_out_rows(self._left_out.of_each, joint, self._at)
        columns = np.zeros((len(X), len(self._at), X.shape[2]))
        columns[:, loads] = X
        fixed, free = columns[:, self._fixed], columns[:, self._free]
        alone = fixed.swapaxes(1, 2) @ (inverse[first] @ fixed)
        return alone, free - self._taken[first].T @ fixed
