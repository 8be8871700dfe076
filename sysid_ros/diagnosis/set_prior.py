"""How usual a set of causes is before any data, how inexact links may be, and which terms are allowed and seen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import special

from sysid_ros.diagnosis.fit import Fit, Problem
from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, Scope
from sysid_ros.sample import FloatArray

_WORLDS = (1.0, 0.1)
"""How much of what real arms have an arm has: a real one, or a simulation made for one purpose. Each as likely as the other."""
_ALIKE = 1.0
"""Number of joints that a guess of how many have an effect is worth: joints of one arm are built alike."""
_MASSES, _PLACES = (0.3, 1.0, 4.0), (0.05, 0.3, 1.0, 4.0)
INEXACT = ((0.0, 0.0), *product(_MASSES, _PLACES))
"""Of masses and of places, in units of the usual inexactness; first links that are exact."""
_SEEN = 0.012
"""Least part of the nominal residual (rms) that an effect must make on one of its joints."""
_SEEN_OF_ALL = 0.003
"""Least part of the nominal residual of all joints (rms, each over its noise), for effects that not every arm has."""
_FLOORS, _FLOORS_OF_NOISE = 0.4, 1.0
"""Least size (rms) of such an effect in noise floors, all joints together, and where its columns hold the noise themselves."""
_EDGE = 0.1
"""What changes within this part of the recordings from their start or end is no event: it may have been there always."""


class SetPrior:
    """Log-probability of sets of terms.

    Each effect is on each joint with a probability that is its own on this arm, from a beta distribution around how usual it is:
    an arm on which most joints have it has it on all. In a simulation all of them are rarer. A form is one of those that were
    tried, all alike. A parameter is as uncertain before any data as one row would leave it (the unit information prior of Kass
    and Wasserman 1995): beyond what it costs a prediction, which is 1, it so costs ``log(rows) / 2 - 1``.

    Args:
        library: its candidates say how many forms were tried of each effect at each place.
    """

    def __init__(self, library: Library, joints: Sequence[int]) -> None:
        self._places: dict[str, int] = {}
        motions, n = library.motions, library.robot.n
        self._parameter = max(0.5 * float(np.log(len(library.band.f))) - 1.0, 0.0)
        self._forms: dict[tuple[str, int | None], float] = {}
        for kind in EFFECTS.values():
            if kind.scope is Scope.JOINT:
                self._places[kind.id] = len(joints)
                for j in joints:
                    self._forms[kind.id, int(j)] = float(np.log(max(len(library.local_options(kind.id, int(j))), 1)))
            else:
                self._places[kind.id] = n if kind.scope is Scope.LINK else 1
                for place in range(n) if kind.scope is Scope.LINK else (None,):
                    self._forms[kind.id, place] = float(np.log(max(len(kind.candidates(motions, place)), 1)))

        self._beside: tuple[tuple[Term, ...] | None, NDArray[np.intp], float] = (None, np.zeros(0, dtype=np.intp), 0.0)
        self._none = np.array([sum(self._without(id_, factor) for id_ in self._places) for factor in _WORLDS])
        self._number = {id_: i for i, id_ in enumerate(self._places)}
        self._most = np.array(list(self._places.values()))
        self._of = np.zeros((len(self._places), int(self._most.max()) + 1, len(_WORLDS)))
        for id_, i in self._number.items():
            self._of[i, : self._places[id_] + 1] = np.stack([self._table(id_, factor) for factor in _WORLDS], axis=-1)

    def log(self, terms: Sequence[Term]) -> float:
        """Of a set, up to a constant."""
        return self.of(self.counts([self.number(t) for t in terms]), sum(self.cost(t) for t in terms))

    def number(self, term: Term) -> int:
        """Which effect a term is, as :meth:`counts` wants it."""
        return self._number[term.id]

    def counts(self, numbers: Sequence[int] | NDArray[np.intp]) -> NDArray[np.intp]:
        """How many terms a set has of each effect. Args: numbers: the effect of each term."""
        return np.bincount(np.asarray(numbers, dtype=np.intp), minlength=len(self._most))

    def of(self, counts: NDArray[np.intp], cost: float) -> float:
        """Of sets with so many terms of each effect and with terms that cost so much in all, up to a constant."""
        worlds = self._none + self._of[np.arange(len(counts)), np.minimum(counts, self._most)].sum(axis=0)
        most = worlds.max()
        return float(most + np.log(np.sum(np.exp(worlds - most)))) - cost

    def cost(self, term: Term) -> float:
        """What a term costs for its parameters and for being one of several forms."""
        place = term.joints[0] if EFFECTS[term.id].scope is not Scope.ARM else None
        return self._forms.get((term.id, place), 0.0) + self._parameter * term.cost

    def price(self, term: Term, present: tuple[Term, ...]) -> float:
        """Likelihood that a term must gain beside others: what its parameters cost a prediction, and how unusual it is there."""
        if self._beside[0] is not present:
            counts = self.counts([self.number(t) for t in present])
            self._beside = present, counts, self.of(counts, 0.0)
        _, counts, usual = self._beside
        more = counts + self.counts([self.number(term)])
        return max(term.cost + self.cost(term) + usual - self.of(more, 0.0), 1.0)

    def _table(self, id_: str, factor: float) -> FloatArray:
        """Log-probability of each number of places that have an effect less that of none, shape (places + 1,)."""
        kind, places = EFFECTS[id_], self._places[id_]
        usual, count = factor * kind.usual, np.arange(places + 1)
        if kind.scope is not Scope.JOINT:
            # of a whole arm, or of one link among all: so usual on the arm, wherever it is
            usual /= places
            return np.asarray(count * np.log(usual / (1.0 - usual)))
        a, b = _ALIKE * usual, _ALIKE * (1.0 - usual)
        return np.asarray(special.betaln(a + count, b + places - count) - special.betaln(a, b + places))

    def _without(self, id_: str, factor: float) -> float:
        kind, places = EFFECTS[id_], self._places[id_]
        usual = factor * kind.usual
        if kind.scope is not Scope.JOINT:
            return places * float(np.log1p(-usual / places))
        a, b = _ALIKE * usual, _ALIKE * (1.0 - usual)
        return float(special.betaln(a, b + places) - special.betaln(a, b))


def _step(sizes: tuple[float, ...], a: float, b: float) -> bool:
    order = (0.0, *sizes)
    return abs(order.index(a) - order.index(b)) <= 1


BESIDE = tuple(
    tuple(k for k, b in enumerate(INEXACT) if b != a and _step(_MASSES, a[0], b[0]) and _step(_PLACES, a[1], b[1]))
    for a in INEXACT
)
"""Those that are a step from each."""


def allowed(problem: Problem, fit: Fit, term: Term) -> bool:
    """True for a term that physics allows, and for an event that lies well inside of the recordings."""
    return term.possible(fit.theta_of(term), fit.std_of(term)) and _inside(problem, term)


def _inside(problem: Problem, term: Term) -> bool:
    if term.instant is None:
        return True
    within = [m.t for m in problem.band.motions if not term.recording or m.recording == term.recording]
    start, end = min(t[0] for t in within), max(t[-1] for t in within)
    return bool(_EDGE < (term.instant - start) / (end - start) < 1.0 - _EDGE)


def visible(problem: Problem, fit: Fit, term: Term) -> bool:
    """True where a term is a part of the nominal residual that is worth telling, over the noise of each joint."""
    active = [int(j) for j in problem.active]
    torque = term.columns @ fit.theta_of(term)
    share = torque if term.row is None else torque[:, None]
    rows = active if term.row is None else [term.row]
    power = np.sum(share[:, active if term.row is None else [0]] ** 2, axis=0)
    nominal = np.sum(problem.y**2, axis=0)
    noise = np.sum(fit.variance, axis=0)
    if not np.any(power > _SEEN**2 * nominal[rows]):
        return False
    if term.expected:
        return True
    floors = float(np.sum(power / noise[rows]))
    least = _FLOORS_OF_NOISE if term.effect.from_measured else _FLOORS
    return floors > max(least**2, _SEEN_OF_ALL**2 * float(np.sum(nominal[active] / noise[active])))
