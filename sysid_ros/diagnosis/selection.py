"""Selection: which effects explain the residual. Likelihood proposes them; sets of them are judged by what they predict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import partial

from sysid_ros.diagnosis.band import RowNoise
from sysid_ros.diagnosis.corrections import correct
from sysid_ros.diagnosis.fit import Fit, Problem, allowed
from sysid_ros.diagnosis.heldout import HeldOut, no_worse
from sysid_ros.diagnosis.knobs import made_anew, refine, sharpened
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import before_gains, torques
from sysid_ros.diagnosis.scoring import ComplianceScreen, Proposal, Score, Scorer, event, forms, met, proposal, refined
from sysid_ros.diagnosis.set_search import SetSearch
from sysid_ros.diagnosis.sets.never_known import dry_friction
from sysid_ros.diagnosis.sets.posterior import Posterior, on_own_torques
from sysid_ros.diagnosis.sets.rival_forms import in_likeliest_form, weighed
from sysid_ros.diagnosis.sets.set_prior import SetPrior
from sysid_ros.diagnosis.sets.state import State
from sysid_ros.diagnosis.sets.stretches import Rows
from sysid_ros.diagnosis.term import Term, best_of_each, joined, one_on_each, replaces_any
from sysid_ros.effects import EFFECTS, Effect
from sysid_ros.sample import FloatArray

Key = tuple[str, tuple[int, ...]]

_TRIED_IN_FULL, _REFINED, _MOST_STEPS = 10, 4, 24
_SCREENED = 0.5
"""Part of its price that a term must seem to gain: it gains more once the slow noise that it was taken for is found anew."""
_AGAIN = 2
"""How often the knobs of what is usual are searched, each time near the last; and how often what does not stay is proposed."""
_USUAL = 0.5
"""Effects that so many joints have are there on all of them when the search begins."""


class Selection:
    """Steps forward by likelihood, each with the noise that fits it best; after each the most probable set of what was proposed.

    The search begins with what is usual on every joint, and with links as inexact as those of any URDF.

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
        self._progress, self._allowed = progress, partial(allowed, problem)
        self._joints, self._whole = [int(j) for j in problem.active], library.whole_options()
        self._screen, self.prior = ComplianceScreen(library), SetPrior(library, self._joints)
        each = [(name, j) for name in library.of_joints for j in self._joints]
        self.tried = len(self._whole) + sum(len(library.local_options(*x)) for x in each)
        usual = [library.local(name, j) for name, j in each if EFFECTS[name].usual >= _USUAL]
        self.fit = problem.fit(usual, inexact=True)
        for _ in range(_AGAIN):
            self._again(lambda t: bool(t.effect.knobs))
        self.pool, self._looked, self.first = list(self.fit.terms), set[tuple[object, frozenset[Key]]](), list[Proposal]()
        self._dropped: list[tuple[Term, frozenset[Key]]] = []  # with what they could not stay beside; any climb may take them

    def on(self, problem: Problem, library: Library, nominal: Sequence[FloatArray]) -> Selection:
        """What was found, and all that was proposed, on other rows of the same robot."""
        other, links = copy(self), [m.link_torque for m in library.motions]
        other.problem, other.library, other._nominal, other._links = problem, library, nominal, links
        other._allowed, other._joints = partial(allowed, problem), [int(j) for j in problem.active]
        other._screen, other.prior = ComplianceScreen(library), SetPrior(library, other._joints)
        other._whole, other._dropped = [], []
        made = {key: library.remake(t) for key, t in {t.exact_key: t for t in [*self.pool, *self.fit.terms]}.items()}
        problem.scale, other.pool = self.problem.scale, list(made.values())
        correct(problem, library, terms := [made[t.exact_key] for t in self.fit.terms])
        other.fit = problem.fit(terms, self.fit.noise, inexact=self.fit.inexact)
        return other

    def settle(self) -> None:
        """The most probable set that is reached from the present one, with events that lay between the rows before."""
        self.refresh()
        self.date()
        self.sharpen()
        events = self.library.whole_options(lambda kind: bool(kind.instant))
        while step := event(self.problem, self.library, self.fit, events, self._allowed, self.price):
            self.fit, self.pool = step.fit, [*self.pool, *step.terms]
        self.climb()

    def price(self, term: Term) -> float:
        """Likelihood that a term must gain: what its parameters cost a prediction (one each), and how unusual it is here."""
        return self.prior.price(term, self.fit.terms)

    def run(self) -> Fit:
        """The most probable set."""
        settled = set[frozenset[Key]]()
        for _ in range(_MOST_STEPS):
            step, before = self.propose(), self._keys()
            if step is not None:
                self._progress(step.words)
                self.fit = step.fit
                self.climb(thorough=False)
                if self._keys() != before or before in settled:
                    continue
            settled.add(self._keys())
            self.date()
            self.sharpen()
            self._add_forms()
            self._add_rivals()
            self.climb()
            if step is None and self._keys() in settled:
                break
        return self.fit

    def _add_forms(self) -> None:
        for term in list(self.fit.terms):
            if term.row is not None and term.effect.family and self._first(term.key, self._keys(term)):
                self.pool += forms(self.problem, self.library, self.fit, term)
            if term.row is not None and not any(knob.reported for knob in term.effect.knobs):
                self.pool += self.library.local_options(term.id, term.row)

    def _add_rivals(self) -> None:
        """What would be proposed if one of the effects that not every joint has were not there."""
        whole = self.fit
        for kind in dict.fromkeys(t.kind for t in whole.terms if t.row is None):
            if self._first(kind, self._keys()):
                self.fit = self.problem.fit([t for t in whole.terms if t.kind is not kind], whole.noise, inexact=whole.inexact)
                self.pool += [t for p in self.proposals(without=kind) for t in p.terms]
                self.fit = whole

    def _first(self, what: object, beside: frozenset[Key]) -> bool:
        """True the first time that something is looked at beside these terms."""
        first = (what, beside) not in self._looked
        self._looked.add((what, beside))
        return first

    def climb(self, thorough: bool = True) -> None:
        """The most probable set that is reached from the present one, with columns that are made of its own torques.

        While sets are compared a gain is one of the torques that the climb began with: what made them may leave, and gains with
        lighter links stand in for it. Where columns of the set that was reached explain less, it begins again without them.
        """
        without = set[Key]()
        while True:
            before, asked = self.fit, [t for t in self._asked() if t.key not in without]
            self.fit = self._climbed([(self.problem, lambda term: term)], asked, thorough)[1]
            self._dropped += [(t, self._keys(t)) for t in before.terms if t not in self.fit.terms]
            new = {t.key for t in self.fit.terms if t.on_torques} - {t.key for t in before.terms}
            if not self._stale() or not new:
                return
            self.fit, without = before, without | new
            self.refresh()

    def judged_with(self, held: HeldOut) -> Posterior:
        """The most probable set, and how probable its terms are, by what is predicted of fitted and of held-out recordings."""
        posterior, before = in_likeliest_form(self, held, self._judged), self.fit.terms
        if any(t.effect.of_own_torque for t in before):
            self.library.apart = held.library.apart = False
            self.fit = before_gains(self.fit)
            self.refresh()
        held.update(self.fit)
        return posterior.of(dict(zip(before, self.fit.terms, strict=True)))

    def _judged(self, held: HeldOut) -> Posterior:
        asked = self._asked(held)
        rows: list[Rows] = [(self.problem, lambda term: term), (held.prepared.problem, lambda term: held.terms[term])]
        anew = partial(on_own_torques, self.problem, self.library, links=self._links, nominal=self._nominal)
        weigh = partial(weighed, self, held, rows, anew)
        while True:
            for again in (True, False):
                state, self.fit, search = self._climbed(rows, asked)
                before = self.fit.terms
                if not (again and self._stale(held)):
                    break
                asked = self._asked(held)
            posterior = weigh(search, state).of(same := dict(zip(before, self.fit.terms, strict=True)))
            asked = [t for x in asked if posterior.nothing.get(t := same.get(x, x), 0.0) < 0.5]
            if all(p < 0.5 for p in posterior.nothing.values()):
                break
            self.fit = self.problem.fit([t for t in self.fit.terms if t in asked], self.fit.noise, 0, self.fit.inexact)
        simpler = no_worse(self.problem, self.library, self.fit, held)
        if simpler is self.fit:
            return posterior
        terms, self.fit = self.fit.terms, simpler
        search, plain = self.among(rows, list(dict.fromkeys([*terms, *asked])), simpler.noise)
        return weigh(search, plain, search.state([search.pool.index(t) for t in terms], state.scale))

    def _stale(self, held: HeldOut | None = None) -> bool:
        """Make columns anew that depend on torques; True where a term may be there only for another set's."""
        before = self.fit.loglik
        if held is None or any(t.on_torques for t in self.fit.terms):
            self.refresh()
            if held is not None:
                held.update(self.fit)
        return before - self.fit.loglik > max(map(self.price, self.fit.terms), default=0.0)

    def among(self, rows: Sequence[Rows], asked: Sequence[Term], noise: RowNoise) -> tuple[SetSearch, State]:
        """A search among the fit's terms and others, and its state at the fit."""
        about = self.prior, noise, dry_friction(self.library.robot, self.fit), self._allowed
        return SetSearch.from_fit(self.problem, self.fit, rows, asked, *about)

    def _climbed(self, rows: Sequence[Rows], asked: Sequence[Term], thorough: bool = True) -> tuple[State, Fit, SetSearch]:
        noise = self.fit.noise
        for _ in range(1 + thorough):
            search, state = self.among(rows, (), noise)
            noise = search.left_out.of_each.noise(state.predicted.left)
        search, state = self.among(rows, asked, noise)
        state = search.climb(state, thorough)
        return state, search.fit(state.members, state.scale, search.left_out.of_each.noise(state.predicted.left)), search

    def _asked(self, held: HeldOut | None = None) -> list[Term]:
        """Everything that was proposed, and the best form of every effect of one joint; no other events beside held-out rows."""
        out: dict[tuple[Key, str], Term] = {}
        scorer = Scorer(self.problem, self.fit)
        for name in self.library.of_joints:
            for j in self._joints:
                out |= {best.term.exact_key: best.term for best in self._best_options(scorer, name, j)}
        sized = {t.key for t in self.fit.terms if t.effect.deflection}  # has columns of one size: no other stands in for it
        out |= {t.exact_key: t for t in [*(t for t in self.pool if t.key not in sized), *self.fit.terms]}
        asked = [t for t in out.values() if held is None or t.instant is None or t in self.fit.terms]
        if held is not None:
            held.add(asked)
        return asked

    def date(self) -> None:
        """Find the times of events anew, with all that was found after them."""
        before = self.fit
        self._again(lambda t: t.instant is not None)
        self.fit = met(self.problem, self.library, max(self.fit, before, key=lambda fit: fit.loglik))

    def _again(self, which: Callable[[Term], bool]) -> None:
        self.fit = refine(self.problem, self.library, self.fit, list(filter(which, self.fit.terms)))

    def sharpen(self) -> None:
        """Move the knobs to where the rows are the most likely: each by itself, then all together."""
        self._again(lambda t: bool(t.effect.knobs) and t.instant is None)
        self.fit = sharpened(self.problem, self.library, self.fit, self._links, self._nominal)

    def refresh(self, pool: bool = True) -> None:
        """Make anew the columns that depend on torques, or what the links weigh, with the present fit; the pool's, too."""
        self.library.update(*torques(self.library, self.fit, self._links, self._nominal))
        self.fit = made_anew(self.problem, self.library, self.fit, self._links, self._nominal)
        if pool:
            self._whole, self.pool = (self.library.newest(x) for x in (self._whole, self.pool))

    def propose(self) -> Proposal | None:
        """The best step forward, or None where nothing gains its price; all that were proposed stay in the pool."""
        found = self.proposals()
        self.pool, self.first = [*self.pool, *(t for p in found for t in p.terms)], self.first or found
        return max(found, key=lambda p: p.score, default=None)

    def proposals(self, without: type[Effect] | None = None) -> list[Proposal]:
        """Every step forward that gains its price, but for one effect and some terms; the likeliest are refined."""
        scorer = Scorer(self.problem, self.fit)
        groups: list[tuple[float, list[Term]]] = []
        local: list[tuple[float, Term]] = []
        # what includes others is tried in their place only
        for name in (x for x in self.library.of_joints if EFFECTS[x] is not without and not EFFECTS[x].includes):
            scores = [s for j in self._joints for s in self._best_options(scorer, name, j) if not self._tried(s.term)]
            gains = [(s.gain - self.price(s.term), s.term) for s in scores]
            better = (
                [x for x in gains if x[0] > 0.0 and replaces_any(x[1], self.fit.terms) is replaces] for replaces in (False, True)
            )
            groups += [(sum(gain for gain, _ in some), [term for _, term in some]) for some in better if some]
            groups += [(gain, [term]) for gain, term in gains if gain <= 0.0]
            local += gains
        groups += one_on_each(local)
        for term in [*self._whole, *self._screen.terms(self.fit)]:
            if term.kind is without or self._tried(term) or any(term.same(t) for t in self.fit.terms):
                continue
            group = self.library.with_companion(term, self.fit.terms)
            score, price = scorer.whole(joined(group)), sum(map(self.price, group))
            if score.gain > _SCREENED * price and term.possible(score.theta[: term.p], score.std[: term.p]):
                groups.append((score.gain - price, group))
        groups = best_of_each(groups)
        found = [proposal(self.problem, self.fit, terms, self._allowed, self.price) for _, terms in groups[:_TRIED_IN_FULL]]
        proposals = sorted((p for p in found if p is not None), key=lambda p: -p.score)
        return [refined(self.problem, self.library, p) for p in proposals[:_REFINED]] + proposals[_REFINED:]

    def _best_options(self, scorer: Scorer, name: str, joint: int) -> list[Score]:
        """Of the forms of an effect on a joint the best that stands beside what is there, and the best in place of it."""
        present = self._keys()
        options = [t for t in self.library.local_options(name, joint) if t.key not in present]
        best: dict[bool, Score] = {}
        for s in scorer.local(options) if options else []:
            replaces = replaces_any(s.term, self.fit.terms)
            if s.gain > _SCREENED * self.price(s.term) and (replaces or s.term.possible(s.theta, s.std)):
                best[replaces] = max(best.get(replaces, s), s, key=lambda s: s.gain)
        return list(best.values())

    def _tried(self, term: Term) -> bool:
        """True for what did not stay beside the present terms, or beside several others: any climb may take it from the pool."""
        beside = [keys for t, keys in self._dropped if term.same(t)]
        return len(beside) >= _AGAIN or self._keys(term) in beside

    def _keys(self, term: Term | None = None) -> frozenset[Key]:  # of all terms, or those that load the same joints as one does
        row = term.row if term else None
        return frozenset(t.key for t in self.fit.terms if t.row is None or row is None or t.row == row)
