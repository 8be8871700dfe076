"""Selection: which effects explain the residual, by likelihood, one step after the other and back again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.diagnosis.cross_validation import worth
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.friction_forms import forms, simplest
from sysid_ros.diagnosis.library import LINK_SIDE, LOCAL, MEASUREMENT, ON_DRIVE, ON_LOAD, Library
from sysid_ros.diagnosis.physics import allowed
from sysid_ros.diagnosis.refine import refine, remake
from sysid_ros.diagnosis.scoring import Score, Scorer
from sysid_ros.diagnosis.term import DRY, Term
from sysid_ros.sample import FloatArray

_TRIED_IN_FULL = 10
_REFINED = 4
_MOST_STEPS = 24
_SWAPS = 3
_SWAPPED = 3
"""Effects on more joints than this are not swapped for others."""
_CLEARLY = 5.0
"""Likelihood by which another effect must be better to take the place of one that was chosen."""
_ELSEWHERE = 3.0
"""Likelihood that a term must gain on segments that it was not fitted to."""
ON_EVENTS = ("payload_change",)
"""Effects that happen once: the segments before tell nothing of those after."""
_SEEN_OF_ALL = 0.03
"""Least part of the nominal residual of all joints (rms, each over its noise), for effects that not every arm has."""
EXPECTED = (*DRY, "viscous_friction", "rotor_inertia", "torque_offset")
"""Effects that every arm has on every joint, large or small."""
_SEEN = 0.04
"""Least part of the nominal residual (rms) that an effect must make on one of its joints."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """Terms of one effect that would be added together, and the likelihood less its price that they gain."""

    terms: tuple[Term, ...]
    score: float
    fit: Fit

    @property
    def words(self) -> str:
        """What is proposed."""
        if not self.terms:
            return "links that are not exactly as the URDF says"
        names = self.terms[0].effect.robot.joint_names
        return f"{self.terms[0].effect.label} on {', '.join(names[t.joints[0]] for t in self.terms)}"


class Selection:
    """Forward steps with backward checks.

    A step takes the effect that gains the most likelihood, each with the noise that fits it best, less the price of its
    parameters and of having been chosen among many. The simplest form of dry friction comes first.

    Args:
        problem: the rows. library: the candidates. nominal: torque of the nominal model on the library's motions.
        excluded: names that are not tried.
    """

    def __init__(
        self,
        problem: Problem,
        library: Library,
        nominal: Sequence[FloatArray],
        excluded: Sequence[str] = (),
        progress: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        self.problem, self.library, self._nominal = problem, library, nominal
        self._links = [m.link_torque for m in library.motions]
        self._progress = progress
        self._joints = [int(j) for j in problem.active]
        self._excluded = set(excluded)
        self._whole = [t for t in library.whole_options() if t.id not in self._excluded]
        self.tried = len(self._whole) + sum(len(library.local_options(name, j)) for name in LOCAL for j in self._joints)
        self.fit = problem.fit([])

    def price(self, term: Term) -> float:
        """Likelihood that a term must gain to be worth its parameters (BIC) and its having been picked among many."""
        rows = len(self.problem.band.f) * (1 if term.row is not None else len(self._joints))
        return 0.5 * term.cost * float(np.log(rows)) + float(np.log(self.tried))

    def run(self) -> Fit:
        """The terms that earn their place."""
        swaps = _SWAPS
        seen: set[frozenset[tuple[str, tuple[int, ...]]]] = set()
        for _ in range(_MOST_STEPS):
            state = frozenset(t.key for t in self.fit.terms) | ({("inexact", ())} if self.fit.inexact else set())
            step = None if state in seen else self.propose()
            seen.add(state)
            if step is not None:
                self._progress(step.words)
                self.fit = step.fit
                self.prune()
                self.refresh()
                continue
            self.simplify()
            self.prune()
            self.refresh()
            if frozenset(t.key for t in self.fit.terms) == state - {("inexact", ())} and not (swaps and self.swap()):
                break
            swaps -= 1
        return self.fit

    def refresh(self) -> None:
        """Make anew the columns that depend on torques, with those of the present fit."""
        link, drive = torques(self.library, self.fit, self._links, self._nominal)
        self.library.update(link, drive)
        self._whole = [remake(self.library, t, t.effect.settings) if t.id in ON_LOAD + ON_DRIVE else t for t in self._whole]
        if any(t.id in ON_LOAD + ON_DRIVE for t in self.fit.terms):
            terms = [remake(self.library, t, t.effect.settings) if t.id in ON_LOAD + ON_DRIVE else t for t in self.fit.terms]
            self.fit = self.problem.fit(terms, self.fit.noise, inexact=self.fit.inexact)
            self.fit = refine(self.problem, self.library, self.fit, [t for t in terms if t.id in ON_LOAD + ON_DRIVE])

    def simplify(self) -> None:
        """Give each joint the simplest form of dry friction that explains it."""
        for joint in self._joints:
            present = next((t for t in self.fit.terms if t.row == joint and t.id in DRY), None)
            if present is None:
                continue
            found = forms(self.problem, self.library, self.fit, present)
            if found:
                self.fit = simplest(found, {f.term.id: self.price(f.term) for f in found}).fit
            self._straighten(joint)

    def propose(self) -> Proposal | None:
        """The best step forward, or None where nothing is worth its price."""
        return max(self.proposals(), key=lambda p: p.score, default=None)

    def rivals(self, terms: Sequence[Term]) -> list[Proposal]:
        """Other effects in the place of ``terms``, which are in the fit; the score is relative to the fit without them."""
        whole = self.fit
        self.fit = self.problem.fit([t for t in whole.terms if t not in terms], whole.noise, inexact=whole.inexact)
        try:
            return self.proposals(terms[0].id)
        finally:
            self.fit = whole

    def _straighten(self, joint: int) -> None:
        """Try a straight line against the speed, with each form of dry friction, in place of a curve: Stribeck's fall at low
        speed and a rise with the square of the speed bend the same way."""
        curved = next((t for t in self.fit.terms if t.row == joint and t.id == "quadratic_friction"), None)
        if curved is None:
            return
        others = [t for t in self.fit.terms if t is not curved and not (t.row == joint and t.id == "viscous_friction")]
        trial = self.problem.fit(
            [*others, self.library.local("viscous_friction", joint)], self.fit.noise, inexact=self.fit.inexact
        )
        present = next((t for t in trial.terms if t.row == joint and t.id in DRY), None)
        found = forms(self.problem, self.library, trial, present) if present is not None else []
        if not found:
            return
        best = simplest(found, {f.term.id: self.price(f.term) for f in found}).fit
        paid = sum(map(self.price, best.terms)) - sum(map(self.price, self.fit.terms))
        if best.loglik - self.fit.loglik > paid:
            self.fit = best

    def swap(self) -> bool:
        """Put another effect in the place of one that explains less than it would; True where there was one."""
        for name in dict.fromkeys(t.id for t in self.fit.terms):
            terms = [t for t in self.fit.terms if t.id == name]
            if name in EXPECTED or len(terms) > _SWAPPED:
                continue
            best = max(self.rivals(terms), key=lambda p: p.score, default=None)
            if best is None:
                continue
            paid = sum(map(self.price, self.fit.terms)) - sum(map(self.price, best.fit.terms))
            if best.fit.loglik + paid > self.fit.loglik + _CLEARLY:
                self._progress(f"{best.words}, in place of {terms[0].effect.label}")
                self.fit = best.fit
                return True
        return False

    def proposals(self, without: str = "") -> list[Proposal]:
        """Every step forward that is worth its price, but for one effect; the likeliest are refined."""
        scorer = Scorer(self.problem, self.fit)
        groups: list[tuple[float, list[Term]]] = []
        for name in LOCAL:
            if name in self._excluded or name in (
                without,
                "friction_drift",
            ):  # holds two other frictions: tried in their place only
                continue
            scores = [s for j in self._joints if (s := self._best_option(scorer, name, j)) is not None]
            if scores:
                groups.append((sum(s.gain - self.price(s.term) for s in scores), [s.term for s in scores]))
        for term in self._whole:
            if term.id == without or any(term.key == t.key for t in self.fit.terms):
                continue
            score = scorer.whole(term)
            if score.gain > self.price(term) and allowed(term, score.theta, score.std):
                groups.append((score.gain - self.price(term), [term]))
        groups.sort(key=lambda g: -g[0])
        proposals = [p for _, terms in groups[:_TRIED_IN_FULL] if (p := self._try(terms)) is not None]
        proposals.sort(key=lambda p: -p.score)
        proposals = [self._refined(p) for p in proposals[:_REFINED]] + proposals[_REFINED:]
        if not self.fit.inexact and (p := self._inexact()) is not None:
            proposals.append(p)
        return proposals

    def _inexact(self) -> Proposal | None:
        fit = self.problem.fit(list(self.fit.terms), self.fit.noise, inexact=True)
        score = fit.loglik - self.fit.loglik - float(np.log(self.tried))
        return Proposal((), score, fit) if score > 0.0 else None

    def _best_option(self, scorer: Scorer, name: str, joint: int) -> Score | None:
        options = [t for t in self.library.local_options(name, joint) if not any(t.key == other.key for other in self.fit.terms)]
        if not options:
            return None
        scores = [
            s for s in scorer.local(options) if s.gain > self.price(s.term) and (self._replaces(s.term) or self._possible(s))
        ]
        return max(scores, key=lambda s: s.gain, default=None)

    def _replaces(self, term: Term) -> bool:
        return any(term.excludes(other) for other in self.fit.terms)

    @staticmethod
    def _possible(score: Score) -> bool:
        return allowed(score.term, score.theta, score.std)

    def _try(self, terms: list[Term]) -> Proposal | None:
        new = list(terms)
        while new:
            kept = [t for t in self.fit.terms if not any(t.excludes(n) for n in new)]
            fit = self.problem.fit([*kept, *new], self.fit.noise, inexact=self.fit.inexact)
            wrong = [t for t in new if not allowed(t, fit.theta_of(t), fit.std_of(t)) or not self.visible(fit, t)]
            if not wrong:
                paid = sum(map(self.price, new)) - sum(self.price(t) for t in self.fit.terms if t not in kept)
                score = fit.loglik - self.fit.loglik - paid
                return Proposal(tuple(new), score, fit) if score > 0.0 else None
            new = [t for t in new if t not in wrong]
        return None

    def _refined(self, proposal: Proposal) -> Proposal:
        fit = refine(self.problem, self.library, proposal.fit, proposal.terms)
        terms = fit.terms[len(fit.terms) - len(proposal.terms) :]
        return Proposal(terms, proposal.score + fit.loglik - proposal.fit.loglik, fit)

    def visible(self, fit: Fit, term: Term) -> bool:
        """True where a term is a part of the nominal residual that one can see, over the noise of each joint."""
        torque = term.columns @ fit.theta_of(term)
        share = torque if term.row is None else torque[:, None]
        rows = self._joints if term.row is None else [term.row]
        power = np.sum(share[:, self._joints if term.row is None else [0]] ** 2, axis=0)
        nominal = np.sum(self.problem.y**2, axis=0)
        noise = np.sum(fit.variance, axis=0)
        seen = np.any(power > _SEEN**2 * nominal[rows])
        total = np.sum(nominal[self._joints] / noise[self._joints])
        return bool(seen and (term.id in EXPECTED or np.sum(power / noise[rows]) > _SEEN_OF_ALL**2 * total))

    def prune(self) -> None:
        """Take out, one after the other, what is no longer worth its price or no longer possible."""
        while self.fit.terms:
            worst, margin, without = None, 0.0, self.fit
            elsewhere = worth(self.problem, self.fit)
            for term in self.fit.terms:
                theta, std = self.fit.theta_of(term), self.fit.std_of(term)
                price = self.price(term)
                significance = 0.5 * float(np.sum((theta / np.maximum(std, 1e-30)) ** 2))
                impossible = not allowed(term, theta, std) or not self.visible(self.fit, term)
                impossible = impossible or (elsewhere[term] < _ELSEWHERE and term.id not in ON_EVENTS)
                if significance > 20.0 * price and not impossible:
                    continue
                rest = self.problem.fit([t for t in self.fit.terms if t is not term], self.fit.noise, inexact=self.fit.inexact)
                left = self.fit.loglik - rest.loglik - price - (1e9 if impossible else 0.0)
                if left < margin:
                    worst, margin, without = term, left, rest
            if worst is None:
                return
            self.fit = without


def torques(
    library: Library, fit: Fit, links: Sequence[FloatArray], nominal: Sequence[FloatArray]
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Torque on the link side and on the motor side of the joints with the effects of a fit, shape (N, n) a motion."""
    link, drive = [x.copy() for x in links], [x.copy() for x in nominal]
    for term in fit.terms:
        theta = term.theta_of_effect(fit.theta_of(term))
        if term.id in MEASUREMENT:
            continue
        for i, motion in enumerate(library.motions):
            torque = term.effect.torque_along(motion, theta)
            drive[i] += torque
            if term.id in LINK_SIDE:
                link[i] += torque
    return link, drive


__all__ = ["DRY", "Proposal", "Selection"]
