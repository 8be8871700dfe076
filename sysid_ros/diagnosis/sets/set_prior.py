"""How usual sets of causes are before any data, and how inexact the links of an arm are that has them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special

from sysid_ros.diagnosis.library import Library
from sysid_ros.diagnosis.prepare import SCALES
from sysid_ros.diagnosis.term import Term
from sysid_ros.effects import EFFECTS, Effect, Scope
from sysid_ros.estimators.symmetric import inverse_of
from sysid_ros.sample import FloatArray
from sysid_ros.signals.whittle import Bins

_WORLDS = (1.0, 0.1)
"""How much of what real arms have an arm has: a real one, or a simulation made for one purpose. Each as likely as the other."""
_ALIKE = 1.0
"""Number of joints that a guess of how many have an effect is worth: joints of one arm are built alike."""


_MASSES_OFF = {0.3: 0.1, 1.0: 0.3, 2.0: 0.3, 4.0: 0.3}
"""How often all masses of a real arm are off by so much, in units of the usual inexactness."""
_PLACES_OFF = {0.05: 0.05, 0.3: 0.15, 1.0: 0.3, 2.0: 0.25, 4.0: 0.25}
"""The same of the centres of mass. None is exact: a URDF is drawn before cables, screws, glue and castings."""
_EXACT = 0.5
"""How often the links of a simulation that was made for one purpose are exact."""


def _of_scales() -> FloatArray:
    """Log-probability of each of :data:`.SCALES` in a real arm and in a simulation, shape (scales, worlds)."""
    real = [0.0 if masses == 0.0 else _MASSES_OFF[masses] * _PLACES_OFF[places] for masses, places in SCALES]
    simulated = [_EXACT, *[(1.0 - _EXACT) / (len(SCALES) - 1)] * (len(SCALES) - 1)]
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.column_stack([real, simulated])))


Places = dict[type[Effect], dict[int | None, int]]
"""Where an effect can be, a joint or link, None where it is the whole robot's; and how many forms of it were tried there."""


class SetPrior:
    """Log-probability of sets of terms.

    Each effect is on each joint with a probability that is its own on this arm, from a beta distribution around how usual it is:
    an arm on which most joints have it has it on all. In a simulation all of them are rarer, and links may be exact, as those of
    a real arm are not. A form is one of those that were tried, all alike. A parameter is as uncertain before any data as one row
    would leave it (the unit information prior of Kass and Wasserman 1995): beyond what it costs a prediction, which is 1, it so
    costs ``log(rows) / 2 - 1``.

    Args:
        library: its candidates say how many forms were tried of each effect at each place.
    """

    def __init__(self, library: Library, joints: Sequence[int]) -> None:
        motions, n = library.motions, library.robot.n
        self._library: Library | None = library
        places: Places = {}
        for kind in EFFECTS.values():
            if kind.scope is Scope.JOINT:
                places[kind] = {int(j): len(kind.candidates(motions, int(j))) for j in joints}
            else:
                each = range(n) if kind.scope is Scope.LINK else (None,)
                places[kind] = {place: len(kind.candidates(motions, place)) for place in each}
        self._set(places, len(library.band.f))
        self._torque = np.sqrt(np.mean(np.concatenate([m.tau for m in motions]) ** 2, axis=0))

    @classmethod
    def of_places(cls, places: Places, rows: int) -> SetPrior:
        """Where each effect can be: its places with the number of its forms there; ``rows`` of the recordings."""
        prior = cls.__new__(cls)
        prior._library = None
        prior._set(places, rows)
        return prior

    def _set(self, places: Places, rows: int) -> None:
        self._kinds = {kind.id: kind for kind in places}
        self._places = {kind.id: len(each) for kind, each in places.items()}
        self._parameter = max(0.5 * float(np.log(rows)) - 1.0, 0.0)
        self._forms = {
            (kind.id, place): float(np.log(max(forms, 1))) for kind, each in places.items() for place, forms in each.items()
        }
        self._scales, self._torque = _of_scales(), np.zeros(0)
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

    def of(self, counts: NDArray[np.intp], cost: float, scale: int | None = None) -> float:
        """Of sets with so many terms of each effect and with terms that cost so much in all, up to a constant.

        Args:
            scale: index of the :data:`.SCALES` that the links beside the set have; None: whatever they have.
        """
        worlds = self._none + self._of[np.arange(len(counts)), np.minimum(counts, self._most)].sum(axis=0)
        worlds = worlds if scale is None else worlds + self._scales[scale]
        most = worlds.max()
        return float(most + np.log(np.sum(np.exp(worlds - most)))) - cost

    def cost(self, term: Term) -> float:
        """What a term costs for its parameters and for being one of several forms."""
        place = term.joints[0] if term.kind.scope is not Scope.ARM else None
        return self._forms.get((term.id, place), 0.0) + self._parameter * term.cost

    def costs(self, terms: Sequence[Term], variance: FloatArray, active: NDArray[np.intp]) -> FloatArray:
        """What each term costs beside rows of this variance, shape (K, n), of the joints that count."""
        return np.array([self.cost(t) + self.finer(t, t.std_alone(variance, active)) + self.unsaid(t, variance) for t in terms])

    def unsaid(self, term: Term, variance: FloatArray) -> float:
        """What it costs that a term says nothing of a part of the measured torque: it takes that away, whatever it is, and leaves
        less to be predicted. As a signal of its own, as strong at each frequency as that part is, it is so much less likely than
        noise of this variance, shape (K, n), in the time that it lasts (Whittle's likelihood of both).
        """
        if not term.effect.from_measured or term.row is None or self._library is None:
            return 0.0
        lasts, bins = self._library.lasts(term), Bins.of(self._library.band.f)
        if lasts == 0.0:
            return 0.0
        power, noise = (bins.mean @ x for x in (np.sum(term.columns**2, axis=1), variance[:, term.row]))
        larger = power / (lasts * noise)
        return 0.5 * lasts * float(np.sum(bins.count * (np.log1p(larger) + larger / (1.0 + larger))))

    def finer(self, term: Term, told: FloatArray) -> float:
        """What a term costs beside :meth:`cost` where robots have it so large that rows tell far smaller ones: as much less
        likely is each of these (a normal prior of its usual size, in place of the one that a row would leave).

        Args:
            told: standard deviations that the rows leave of its parameters, the only ones, shape (p,).
        """
        finer = np.log(self._sizes(term) / told) - 1.0 - self._parameter
        return float(np.sum(np.maximum(finer[np.isfinite(finer)], 0.0)))

    def _sizes(self, term: Term) -> FloatArray:
        """How large the columns' parameters are where robots have it, shape (p,); infinite where that is not known."""
        if self._torque.size and term.row is not None and np.isfinite(term.effect.share):
            return term.sizes_that_make(term.effect.share * float(self._torque[term.row]))
        return term.usual_size

    def surely(self, term: Term, others: Sequence[Term], values: FloatArray, covariance: FloatArray) -> float:
        """Probability of a term beside others by what its parameters are known as: how much less they may be nought than before
        any data (the ratio of Savage and Dickey; Dickey, Lientz 1970). 1 where no usual size of all of them is known.

        Args:
            values, covariance: of the columns' parameters with all fitted rows, shape (p,) and (p, p).
        """
        sizes = np.minimum(self._sizes(term), 1.0 / np.sqrt(np.maximum(term.prior, 1e-300)))
        if not np.isfinite(sizes).all() or sizes.max() > 1e100:
            return 1.0
        told = inverse_of(covariance / np.outer(sizes, sizes))
        score, known = told @ (values / sizes), told + np.diag(1.0 - term.prior * sizes**2)
        gained = 0.5 * float(score @ inverse_of(known) @ score - np.linalg.slogdet(known)[1])
        beside = self.counts([self.number(t) for t in others])
        more = beside + self.counts([self.number(term)])
        odds = gained + self.of(more, 0.0) - self.of(beside, 0.0)
        return float(special.expit(odds))

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
        kind, places = self._kinds[id_], self._places[id_]
        usual, count = factor * kind.usual, np.arange(places + 1)
        if kind.scope is not Scope.JOINT:
            # of a whole arm, or of one link among all: so usual on the arm, wherever it is
            usual /= places
            return np.asarray(count * np.log(usual / (1.0 - usual)))
        a, b = _ALIKE * usual, _ALIKE * (1.0 - usual)
        return np.asarray(special.betaln(a + count, b + places - count) - special.betaln(a, b + places))

    def _without(self, id_: str, factor: float) -> float:
        kind, places = self._kinds[id_], self._places[id_]
        usual = factor * kind.usual
        if kind.scope is not Scope.JOINT:
            return places * float(np.log1p(-usual / places))
        a, b = _ALIKE * usual, _ALIKE * (1.0 - usual)
        return float(special.betaln(a, b + places) - special.betaln(a, b))
