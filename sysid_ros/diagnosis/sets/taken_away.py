"""Whether what takes a part of the measured torque away is likelier than that no model knows that part.

A motor at its limit leaves what it was asked for beyond the limit unsaid, and so explains any torque that is large: that of a
friction that the library lacks, too. Its rival is a function of the motion that no effect describes, of the net of
:mod:`..leftover`. Both have that net, each with the noise that makes it the likeliest, and what is taken away pays as a signal of
its own: beside little noise it pays much. A motor gives nothing beyond its limit: all of what was asked beyond it is taken away,
no part of it and not more.

The torque of a joint that hardly changes, as where dry friction is most of it, is near its largest all the time. What exceeds a
limit there is noise, and less of it is left without its tops. How much likelier that makes noise is seen where there is no limit:
in the same recordings with what the rival leaves turned over, which is noise as likely as that. By how much the two differ where
all is noise is seen with it turned over in stretches of time, and in the others (the wild bootstrap; Wu 1986).
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

_DRAWS, _STRETCH = 16, 0.05
"""How often noise is turned over in stretches of time, and how long they are [s]."""
_Taken = tuple[Term, Term]


class TakenAway:
    """What takes measured torque away, against functions of the motion that no effect describes.

    Args:
        train, held: fitted and held-out rows. library: of the former. fit: with the terms. prior: of the sets.
    """

    def __init__(self, train: Prepared, held: HeldOut, library: Library, fit: Fit, prior: SetPrior) -> None:
        self._train, self._held, self._library, self._fit, self._prior = train, held, library, fit, prior
        self._made: dict[int, FloatArray] = {}

    def probability(self, term: Term, joint: int) -> float:
        """Of a term that takes a part of the measured torque of its joint away; before any data both are as likely."""
        others = [t for t in self._fit.terms if t is not term]
        without = self._train.problem.fit(others, self._fit.noise, inexact=self._fit.inexact)
        rival, own = self._beside_functions(without, self._held, joint), self._own(without, term, joint)
        gained = own - self._prior.cost(term) - rival
        if gained > 0.0:
            here, rng = HeldOut(self._train, self._library, {t: t for t in others}), np.random.default_rng(0)
            each = [(m, r) for x in (here, self._held) for m, r in zip(x.library.motions, x.predictions(without), strict=True)]
            left, times = [m.tau - predicted for m, predicted in each], [m.t for m, _ in each]

            def turned(signs: Sequence[FloatArray]) -> float:
                return self._own(without, term, joint, [(1.0 - s)[:, None] * x for s, x in zip(signs, left, strict=True)])

            draws = [[_signs(t, rng) for t in times] for _ in range(_DRAWS)]
            noise = np.array([turned(signs) - turned([-s for s in signs]) for signs in draws])
            over = own - turned([-np.ones(len(t)) for t in times])
            gained = min(gained, _over_noise(over, noise, len(self._train.problem.y)))
        return float(special.expit(gained))

    def _own(self, without: Fit, term: Term, joint: int, less: Sequence[FloatArray] = ()) -> float:
        """Log-likelihood of all rows of a joint without all that a term takes away.

        Args:
            without: a fit without the term. less: so much less was measured, shape (N, n) a motion, the held-out ones last.
        """
        rows, taken = list[Prepared](), list[Term]()
        for x, library, own in (
            (self._train, self._library, term),
            (self._held.prepared, self._held.library, self._held.terms[term]),
        ):
            problem, of_each = copy(x.problem), less[: len(library.motions)]
            problem.y, less = problem.y.copy(), less[len(of_each) :]
            if of_each:
                motions = [m.less(r) for m, r in zip(library.motions, of_each, strict=True)]
                curves = [np.asarray(term.effect.curves_along(m))[:, :, joint] for m in motions]
                own = replace(own, columns=np.ascontiguousarray(x.band.joint_curves(joint, curves)))
                problem.y[:, joint] -= x.band.joint_curves(joint, [r[None, :, joint] for r in of_each])[:, 0]
            problem.y[:, joint] -= own.columns.sum(axis=1)
            rows.append(replace(x, problem=problem))
            taken.append(own)
        fit = rows[0].problem.fit(without.terms, self._fit.noise, inexact=without.inexact)
        held = HeldOut(rows[1], self._held.library, self._held.terms)
        return self._beside_functions(fit, held, joint, (taken[0], taken[1]))

    @cached_property
    def _features(self) -> list[list[FloatArray]]:
        names = self._train.motions[0].robot.joint_names
        return [[np.stack(list(features(m, names).values())) for m in x.motions] for x in (self._train, self._held.prepared)]

    @cached_property
    def _later(self) -> SetPrior:
        return SetPrior(self._held.library, self._held.prepared.problem.active.tolist())

    def _functions(self, joint: int) -> FloatArray:
        """Rows of a joint that functions of the motion make, shape (K, c)."""
        if joint not in self._made:
            bands = self._train.band, self._held.prepared.band
            self._made[joint] = np.concatenate([b.joint_curves(joint, x) for b, x in zip(bands, self._features, strict=True)])
        return self._made[joint]

    def _beside_functions(self, fit: Fit, held: HeldOut, joint: int, taken: _Taken | None = None) -> float:
        """Log-likelihood of all rows of a joint beside functions of the motion, with what a term leaves unsaid.

        Args:
            taken: the term on the fitted rows, and on the held-out ones.
        """
        bands = self._train.band, self._held.prepared.band
        X = self._functions(joint)
        left = [fit.residual, held.residual(fit)]
        coloured = np.concatenate([fit.noise.along(band)[:, joint] for band in bands])
        # what a fit leaves is noise to it: beside white noise other functions are found than beside that
        return max(self._from(v, X, left, joint, taken) for v in (coloured, np.full_like(coloured, np.mean(coloured))))

    def _from(self, variance: FloatArray, X: FloatArray, left: Sequence[FloatArray], joint: int, taken: _Taken | None) -> float:
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
        fitted = self._prior.unsaid(term, here.along(self._train.band))
        return fitted + self._later.unsaid(later_term, there.along(self._held.prepared.band))


def _signs(t: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A sign for each stretch of time, shape (N,)."""
    stretch = ((t - t[0]) / _STRETCH).astype(np.intp)
    return np.asarray(rng.choice([-1.0, 1.0], size=int(stretch[-1]) + 1)[stretch])


def _over_noise(gained: float, noise: FloatArray, rows: int) -> float:
    """Log-odds that a term is more than noise, by what it gains over what it gains with the noise turned over. With noise alone
    that is normal about 0, and some draws of it are known, shape (k,), so that it is Student's t, but for what any log-likelihood
    scatters by; with a term that is there it is anything from what noise scatters by up to one a row, in equal ratios."""
    k, scale = len(noise), float(np.hypot(np.sqrt(np.mean(noise**2)), 1.0))
    student = special.gammaln(0.5 * (k + 1)) - special.gammaln(0.5 * k) - 0.5 * np.log(k * np.pi) - np.log(scale)
    student -= 0.5 * (k + 1) * np.log1p((max(gained, 0.0) / scale) ** 2 / k)
    return float(-np.log(max(gained, scale) * np.log(max(rows, 3))) - student)
