"""Selection: which effects explain the residual, by likelihood, one step after the other and back again."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sysid_ros.diagnosis.backward import prune, visible, without_nuisance
from sysid_ros.diagnosis.compliance_screen import ComplianceScreen
from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.friction_forms import simplify
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.refine import refine, remake
from sysid_ros.diagnosis.scoring import Score, Scorer
from sysid_ros.diagnosis.term import Term, best_of_each, joined
from sysid_ros.diagnosis.torques import links_changed, torques
from sysid_ros.effects import EFFECTS, Depends, Effect
from sysid_ros.sample import FloatArray

Key = tuple[str, tuple[int, ...]]

_TRIED_IN_FULL = 10
_SCREENED = 0.5
"""Part of its price that a term must seem to gain with the noise as it is: what no term explains was taken for slow noise, and a
term gains more once the noise is found anew."""
_REFINED = 4
_MOST_STEPS = 24
_SURELY = 2.0
"""Likelihood beyond both: rows are not quite as independent as they are taken for."""
_SWAPS = 3
_SWAPPED = 3
"""Effects on more joints than this are not swapped for others."""
_CLEARLY = 5.0
"""Likelihood by which another effect must be better to take the place of one that was chosen."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """Terms of one effect that would be added at once, and the likelihood less its price that they gain."""

    terms: tuple[Term, ...]
    score: float
    fit: Fit

    @property
    def words(self) -> str:
        """What is proposed."""
        names = self.terms[0].effect.robot.joint_names
        return f"{self.terms[0].effect.label} on {', '.join(names[t.joints[0]] for t in self.terms)}"


class Selection:
    """Forward steps with backward checks.

    A step takes the effect that gains the most likelihood, each with the noise that fits it best, less the price of its
    parameters and of having been chosen among many. The simplest form of dry friction comes first.

    Args:
        problem: the rows. library: the candidates. nominal: torque of the nominal model on the library's motions.
    """

    def __init__(
        self,
        problem: Problem,
        library: Library,
        nominal: Sequence[FloatArray],
        progress: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        self.problem, self.library, self._nominal = problem, library, nominal
        self._links = [m.link_torque for m in library.motions]
        self._progress = progress
        self._joints = [int(j) for j in problem.active]
        self._whole = library.whole_options()
        self._screen = ComplianceScreen(library)
        self.tried = len(self._whole) + sum(
            len(library.local_options(name, j)) for name in library.of_joints for j in self._joints
        )
        self.fit = problem.fit([], inexact=True)

    def price(self, term: Term) -> float:
        """Likelihood that a term must gain for its parameters (BIC) and its having been picked among many."""
        rows = len(self.problem.band.f) * (1 if term.row is not None else len(self._joints))
        return 0.5 * term.cost * float(np.log(rows)) + float(np.log(self.tried)) + _SURELY

    def run(self) -> Fit:
        """The terms that earn their place."""
        swaps = _SWAPS
        proposed: dict[tuple[Key, ...], set[Key]] = {}
        for _ in range(_MOST_STEPS):
            state = _state(self.fit)
            before = proposed.setdefault(state, set())
            step = self.propose(before)
            if step is not None:
                before.update(t.key for t in step.terms)
                self._progress(step.words)
                self.fit = prune(self.problem, step.fit, self.price)
                self.refresh()
                continue
            self.date()
            self.fit = simplify(self.problem, self.library, self.fit, self._joints, self.price)
            self.fit = prune(self.problem, self.fit, self.price)
            self.refresh()
            if _state(self.fit) in proposed and not (swaps and self.swap()):
                break
            swaps -= 1
        self.fit = without_nuisance(self.problem, self.fit)
        self.fit = simplify(self.problem, self.library, self.fit, self._joints, self.price)
        self.fit = prune(self.problem, self.fit, self.price)
        return self.fit

    def date(self) -> None:
        """Find the times of events anew, with all that was found after them."""
        dated = self._dated(self.fit)
        if dated.loglik > self.fit.loglik:
            self.fit = dated
        # two that were apart may have met: they are one
        while pair := next(
            (p for p in combinations(self.fit.terms, 2) if p[0].instant is not None and p[0].excludes(p[1])), None
        ):
            alone = [[t for t in self.fit.terms if t is not x] for x in pair]
            fits = [self.problem.fit(terms, self.fit.noise, inexact=self.fit.inexact) for terms in alone]
            self.fit = max((self._dated(fit) for fit in fits), key=lambda fit: fit.loglik)

    def _dated(self, fit: Fit) -> Fit:
        return refine(self.problem, self.library, fit, [t for t in fit.terms if t.instant is not None])

    def refresh(self) -> None:
        """Make anew the columns that depend on torques or on what the links weigh, with those of the present fit."""
        link, drive = torques(self.library, self.fit, self._links, self._nominal)
        self.library.update(link, drive)
        self._whole = [remake(self.library, t, t.effect.settings) if t.on_torques else t for t in self._whole]
        carried = links_changed(self.library.robot, self.fit)
        again = {t: dict(t.effect.settings) for t in self.fit.terms if t.on_torques}
        for t in self.fit.terms:
            if Depends.LINKS in t.effect.depends_on and (carried.any() or t.effect.settings.get("links")):
                again[t] = {**t.effect.settings, "links": carried.tolist() if carried.any() else []}
        if again:
            made = {t: remake(self.library, t, settings) for t, settings in again.items()}
            self.fit = self.problem.fit([made.get(t, t) for t in self.fit.terms], self.fit.noise, inexact=self.fit.inexact)
            self.fit = refine(self.problem, self.library, self.fit, list(made.values()))

    def propose(self, before: Collection[Key] = ()) -> Proposal | None:
        """The best step forward, or None where nothing gains its price.

        Args:
            before: names and joints of terms that were tried from here before, and did not stay.
        """
        return max(self.proposals(before=before), key=lambda p: p.score, default=None)

    def rivals(self, terms: Sequence[Term]) -> list[Proposal]:
        """Other effects in the place of ``terms``, which are in the fit; the score is relative to the fit without them."""
        whole = self.fit
        self.fit = self.problem.fit([t for t in whole.terms if t not in terms], whole.noise, inexact=whole.inexact)
        try:
            return self.proposals(terms[0].kind)
        finally:
            self.fit = whole

    def swap(self) -> bool:
        """Put another effect in the place of one that explains less than it would; True where there was one."""
        for kind in dict.fromkeys(t.kind for t in self.fit.terms):
            terms = [t for t in self.fit.terms if t.kind is kind]
            if terms[0].expected or len(terms) > _SWAPPED:
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

    def proposals(self, without: type[Effect] | None = None, before: Collection[Key] = ()) -> list[Proposal]:
        """Every step forward that gains its price, but for one effect and some terms; the likeliest are refined."""
        scorer = Scorer(self.problem, self.fit)
        groups: list[tuple[float, list[Term]]] = []
        for name in self.library.of_joints:
            if EFFECTS[name] is without or EFFECTS[name].includes:  # the latter are tried in the place of others only
                continue
            joints = [j for j in self._joints if (name, (j,)) not in before]
            scores = [s for j in joints if (s := self._best_option(scorer, name, j)) is not None and s.term.key not in before]
            gains = [(s.gain - self.price(s.term), s.term) for s in scores]
            if any(gain > 0.0 for gain, _ in gains):
                groups.append((sum(max(gain, 0.0) for gain, _ in gains), [term for gain, term in gains if gain > 0.0]))
            groups += [(gain, [term]) for gain, term in gains if gain <= 0.0]
        for term in [*self._whole, *self._screen.terms(self.fit)]:
            if term.kind is without or term.key in before or any(_same(term, t) for t in self.fit.terms):
                continue
            group = self.library.with_companion(term, self.fit.terms)
            score, price = scorer.whole(joined(group)), sum(map(self.price, group))
            if score.gain > _SCREENED * price and term.possible(score.theta[: term.p], score.std[: term.p]):
                groups.append((score.gain - price, group))
        groups = best_of_each(groups)
        proposals = [p for _, terms in groups[:_TRIED_IN_FULL] if (p := self._try(terms)) is not None]
        proposals.sort(key=lambda p: -p.score)
        return [self._refined(p) for p in proposals[:_REFINED]] + proposals[_REFINED:]

    def _best_option(self, scorer: Scorer, name: str, joint: int) -> Score | None:
        options = [t for t in self.library.local_options(name, joint) if not any(t.key == other.key for other in self.fit.terms)]
        if not options:
            return None
        scores = [
            s
            for s in scorer.local(options)
            if s.gain > _SCREENED * self.price(s.term) and (self._replaces(s.term) or s.term.possible(s.theta, s.std))
        ]
        return max(scores, key=lambda s: s.gain, default=None)

    def _replaces(self, term: Term) -> bool:
        return any(term.excludes(other) for other in self.fit.terms)

    def _try(self, terms: list[Term]) -> Proposal | None:
        new = list(terms)
        while new:
            kept = [t for t in self.fit.terms if not any(t.excludes(n) for n in new)]
            fit = self.problem.fit([*kept, *new], self.fit.noise, inexact=self.fit.inexact)
            wrong = [t for t in new if not t.possible(fit.theta_of(t), fit.std_of(t)) or not visible(self.problem, fit, t)]
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


def _same(term: Term, other: Term) -> bool:
    return term.key == other.key and (term.instant is None or term.excludes(other))


def _state(fit: Fit) -> tuple[Key, ...]:
    return tuple(sorted(t.key for t in fit.terms))
