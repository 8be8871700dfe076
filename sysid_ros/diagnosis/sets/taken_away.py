"""Whether what takes a part of the measured torque away is likelier than that no model knows that part.

A motor at its limit leaves what it was asked for beyond the limit unsaid, and so explains any torque that is large: that of a
friction that the library lacks, too. Its rival is a function of the motion that no effect describes, of the net of
:mod:`..leftover`. Both have that net, each with the noise that makes it the likeliest, and what is taken away pays as a signal of
its own: beside little noise it pays much.

The torque of a joint that hardly changes, as where dry friction is most of it, is near its largest all the time. What exceeds a
limit there is noise, and less of it is left without its tops. How much likelier that makes noise is seen where there is no limit:
in the same recordings with what the rival leaves turned over, which is noise as likely as that. So much more must a limit bring.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy import special

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.heldout import HeldOut
from sysid_ros.diagnosis.leftover import features, greedy
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

_TURNS = 3
"""How often noise and functions of the motion are found anew, each with the other."""


class TakenAway:
    """What takes measured torque away, against functions of the motion that no effect describes.

    Args:
        train, held: fitted and held-out rows. library: of the former. fit: with the terms. prior: of the sets.
    """

    def __init__(self, train: Prepared, held: HeldOut, library: Library, fit: Fit, prior: SetPrior) -> None:
        self._train, self._held, self._library, self._fit, self._prior = train, held, library, fit, prior

    def probability(self, term: Term, joint: int) -> float:
        """Of a term that takes a part of the measured torque of its joint away; before any data both are as likely."""
        others = [t for t in self._fit.terms if t is not term]
        without = self._train.problem.fit(others, self._fit.noise, inexact=self._fit.inexact)
        rival, cost = self._beside_functions(without, self._held, joint), self._prior.cost(term)
        gained = self._beside_functions(self._fit, self._held, joint, term) - cost - rival
        if gained > 0.0:
            fit, held, turned = self._turned_over(without, term, joint)
            gained -= max(self._beside_functions(fit, held, joint, turned) - cost - rival, 0.0)
        return float(special.expit(gained))

    def _turned_over(self, without: Fit, term: Term, joint: int) -> tuple[Fit, HeldOut, Term]:
        """A fit with the term, and what it is judged on, of recordings with the other sign of what a fit without the term leaves
        of its joint; and the term there."""
        here = HeldOut(self._train, self._library, {t: t for t in without.terms})
        terms, rows = list[Term](), list[Prepared]()
        for x, of_term in ((here, term), (self._held, self._held.terms[term])):
            left = [m.tau - tau for m, tau in zip(x.library.motions, x.predictions(without), strict=True)]
            own = [m.less(2.0 * r) for m, r in zip(x.library.motions, left, strict=True)]
            curves = [np.asarray(term.effect.curves_along(m))[:, :, joint] for m in own]
            terms.append(replace(of_term, columns=np.ascontiguousarray(x.prepared.band.joint_curves(joint, curves))))
            problem = copy(x.prepared.problem)
            problem.y = problem.y.copy()
            problem.y[:, joint] -= 2.0 * x.residual(without)[:, joint]
            rows.append(replace(x.prepared, problem=problem))
        turned, there = terms
        fit = rows[0].problem.fit([*without.terms, turned], self._fit.noise, inexact=without.inexact)
        return fit, HeldOut(rows[1], self._held.library, {**self._held.terms, turned: there}), turned

    @cached_property
    def _features(self) -> list[list[FloatArray]]:
        names = self._train.motions[0].robot.joint_names
        return [[np.stack(list(features(m, names).values())) for m in x.motions] for x in (self._train, self._held.prepared)]

    def _beside_functions(self, fit: Fit, held: HeldOut, joint: int, term: Term | None = None) -> float:
        """Log-likelihood of all rows of a joint beside functions of the motion, with what a term leaves unsaid."""
        bands = self._train.band, self._held.prepared.band
        X = np.concatenate([band.joint_curves(joint, x) for band, x in zip(bands, self._features, strict=True)])
        left = [fit.residual, held.residual(fit)]
        coloured = np.concatenate([fit.noise.along(band)[:, joint] for band in bands])
        # what a fit leaves is noise to it: beside white noise other functions are found than beside that
        taken = () if term is None else (term, held.terms[term])
        return max(self._from(v, X, left, joint, taken) for v in (coloured, np.full_like(coloured, np.mean(coloured))))

    def _from(self, variance: FloatArray, X: FloatArray, left: Sequence[FloatArray], joint: int, taken: Sequence[Term]) -> float:
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
        return likelihood - chosen - (self._unsaid(*taken, *noises) if taken else 0.0)

    def _unsaid(self, term: Term, later_term: Term, here: RowNoise, there: RowNoise) -> float:
        later = SetPrior(self._held.library, self._held.prepared.problem.active.tolist())
        fitted = self._prior.unsaid(term, here.along(self._train.band))
        return fitted + later.unsaid(later_term, there.along(self._held.prepared.band))
