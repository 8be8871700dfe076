"""Whether what takes a part of the measured torque away is likelier than that no model knows that part.

A motor at its limit leaves what it was asked for beyond the limit unsaid, and so explains any torque that is large: that of a
friction that the library lacks, too. Its rival is a function of the motion that no effect describes, of the net of
:mod:`..leftover`. Both have that net, each with the noise that makes it the likeliest, and what is taken away pays as a signal of
its own: beside little noise it pays much.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy import special

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.leftover import features, greedy
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

_TURNS = 3
"""How often noise and functions of the motion are found anew, each with the other."""


class TakenAway:
    """What takes measured torque away, against functions of the motion that no effect describes.

    Args:
        train, held: fitted and held-out rows. fit: with the terms. prior: of the sets.
    """

    def __init__(self, train: Prepared, held: HeldOut, fit: Fit, prior: SetPrior) -> None:
        self._train, self._held, self._fit, self._prior = train, held, fit, prior

    def probability(self, term: Term, joint: int) -> float:
        """Of a term that takes a part of the measured torque of its joint away; before any data both are as likely."""
        others = [t for t in self._fit.terms if t is not term]
        without = self._train.problem.fit(others, self._fit.noise, inexact=self._fit.inexact)
        own = self._beside_functions(self._fit, joint, term) - self._prior.cost(term)
        return float(special.expit(own - self._beside_functions(without, joint)))

    @cached_property
    def _features(self) -> list[list[FloatArray]]:
        names = self._train.motions[0].robot.joint_names
        return [[np.stack(list(features(m, names).values())) for m in x.motions] for x in (self._train, self._held.prepared)]

    def _beside_functions(self, fit: Fit, joint: int, term: Term | None = None) -> float:
        """Log-likelihood of all rows of a joint beside functions of the motion, with what a term leaves unsaid."""
        bands = self._train.band, self._held.prepared.band
        X = np.concatenate([band.joint_curves(joint, x) for band, x in zip(bands, self._features, strict=True)])
        left = [fit.residual, self._held.residual(fit)]
        coloured = np.concatenate([fit.noise.along(band)[:, joint] for band in bands])
        # what a fit leaves is noise to it: beside white noise other functions are found than beside that
        return max(self._from(v, X, left, joint, term) for v in (coloured, np.full_like(coloured, np.mean(coloured))))

    def _from(self, variance: FloatArray, X: FloatArray, left: Sequence[FloatArray], joint: int, term: Term | None) -> float:
        """The same from a noise of this variance on, shape (K,)."""
        bands = self._train.band, self._held.prepared.band
        y, moves, found, noises = (
            np.concatenate([x[:, joint] for x in left]),
            float(bands[0].moves[joint]),
            list[int](),
            list[RowNoise](),
        )
        left = [x.copy() for x in left]
        for _ in range(_TURNS):
            root = 1.0 / np.sqrt(variance)
            found = greedy(X * root[:, None], y * root, len(root) * moves)
            rest = y - X[:, found] @ np.linalg.lstsq(X[:, found] * root[:, None], y * root, rcond=1e-9)[0]
            for rows, x in zip(left, np.split(rest, [len(left[0])]), strict=True):
                rows[:, joint] = x
            noises = [band.noise_of(x) for band, x in zip(bands, left, strict=True)]
            variance = np.concatenate([x.along(band)[:, joint] for x, band in zip(noises, bands, strict=True)])
        # which of all functions, and how large (BIC)
        chosen = len(found) * float(np.log(X.shape[1]) + 0.5 * np.log(len(X) * moves))
        counted = np.concatenate([np.full(len(x), band.counted[joint]) for x, band in zip(left, bands, strict=True)])
        likelihood = -0.5 * float(
            np.sum(counted * np.log(variance) + np.concatenate([x[:, joint] for x in left]) ** 2 / variance)
        )
        return likelihood - chosen - (self._unsaid(term, *noises) if term else 0.0)

    def _unsaid(self, term: Term, here: RowNoise, there: RowNoise) -> float:
        later = SetPrior(self._held.library, self._held.prepared.problem.active.tolist())
        fitted = self._prior.unsaid(term, here.along(self._train.band))
        return fitted + later.unsaid(self._held.terms[term], there.along(self._held.prepared.band))
