"""Generalised least squares in the band, with the noise estimated beside the parameters; how these scatter, and which are seen.

Without one block of time the parameters are ``d_b = -(M - G_b)^-1 g_b`` away from those of all rows, with the score ``g_b`` and
the information ``G_b`` of the block, M of all rows and of what is known before any data. If the noise is what the weights say,
the variance of ``d_b`` is ``(M - G_b)^-1 - M^-1``: the fit has followed the block's noise too. Where ``d_b`` is larger, the rows
within a block are dependent in a way that the weights don't know: a model that is wrong for a while, noise that comes and goes or
that joints share. (The jackknife over clusters, with what residuals lose to a fit taken into account: Bell, McCaffrey 2002;
MacKinnon, Nielsen, Webb 2023.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.band import Band, RowNoise
from sysid_ros.diagnosis.term import Term
from sysid_ros.estimators.symmetric import inverse_of, scaled_to_one
from sysid_ros.sample import FloatArray

Block = tuple[NDArray[np.intp], FloatArray]
"""Which parameters load a joint, and their columns there, shape (K, m_j)."""
_SEEN = 0.004
"""Least part of the nominal residual (rms) that an effect must make on one of its joints: filters and columns are off by a
thousandth or two of it. Of eleven causes below 0.012 (exam seeds hard 98600 to 98611, real 98300 to 98309) nine were true; two
delays, of 0.003 and 0.005, are less than what must be seen of all joints."""
_SEEN_OF_ALL = 0.003
"""Least part of the nominal residual of all joints (rms, each over its noise), for effects that not every arm has."""
_FLOORS = 0.4
"""Least size (rms) of such an effect in noise floors, all joints together."""
_EXACT = 1e-3
"""Part of their usual inexactness that links have which are exact."""
_EDGE = 0.1
"""What changes within this part of the recordings from their start or end is no event: it may have been there always."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A set of terms with the parameters and the noise that make the rows the most likely.

    Attributes:
        terms: in the order of theta. theta: shape (m,), the nuisance parameters last.
        inverse: of the information, shape (m, m).
        noise: of each joint. loglik: of the rows, with the nuisance parameters integrated out.
        residual: shape (K, n). blocks: columns of each active joint. variance: of the coefficients, shape (K, n).
        inexact: whether the nuisance parameters are free. links: as :class:`Problem` has it.
    """

    terms: tuple[Term, ...]
    theta: FloatArray
    inverse: FloatArray
    noise: RowNoise
    loglik: float
    residual: FloatArray
    blocks: dict[int, Block]
    variance: FloatArray
    inexact: bool
    links: FloatArray

    @cached_property
    def links_off(self) -> FloatArray:
        """By how much it has the links inexact, shape (10 n,)."""
        free = len(self.theta) - self.links.shape[1]
        return np.asarray(self.links @ self.theta[free:]) if self.inexact else np.zeros(len(self.links))

    @cached_property
    def slices(self) -> list[slice]:
        """Where each term's parameters stand in theta."""
        out, start = [], 0
        for term in self.terms:
            out.append(slice(start, start + term.p))
            start += term.p
        return out

    def theta_of(self, term: Term) -> FloatArray:
        """Parameters of a term's columns."""
        return self.theta[self.slices[self.terms.index(term)]]

    def std_of(self, term: Term) -> FloatArray:
        """Their standard deviations."""
        where = self.slices[self.terms.index(term)]
        std: FloatArray = np.sqrt(np.maximum(np.diag(self.inverse)[where], 0.0))
        return std


class Estimated(Protocol):
    """Terms with parameters, whatever else is known of them."""

    @property
    def terms(self) -> tuple[Term, ...]:
        """All of them."""

    def theta_of(self, term: Term) -> FloatArray:
        """Parameters of a term's columns."""

    def std_of(self, term: Term) -> FloatArray:
        """Their standard deviations."""


class Problem:
    """The rows to explain.

    Args:
        band: the frequency domain. y: torque that the nominal model leaves, shape (K, n).
        nuisance: columns of what no model gets exactly right, shape (K, n, c). nuisance_std: their usual size, shape (c,).
        scaled_by: which of the two scales the size of each follows, 1 or 2; 0 of what is no link's and always has its usual
            size, the first ones, shape (c,).
        links: change of the links' inertials by each of the others, the last ones, shape (10 n, l); None: there are none.
        gains: joints whose efforts may be in a unit of their own, whatever was undone.
        nominal: torque of the nominal model, shape (N, n) of each motion; empty where no cause needs it.

    Attributes:
        y: rows, corrected for what some causes change of the measured torque. measured: without that.
        scale: by how much more or less than usual masses and places are inexact. considered: how many have their usual size.
    """

    def __init__(
        self,
        band: Band,
        y: FloatArray,
        nuisance: FloatArray,
        nuisance_std: FloatArray,
        scaled_by: NDArray[np.intp],
        links: FloatArray | None = None,
        gains: Sequence[int] = (),
        nominal: Sequence[FloatArray] = (),
    ) -> None:
        self.band, self.y, self.measured, self.nominal = band, y, y, tuple(nominal)
        self.scaled_by, self.considered = scaled_by, int(np.sum(scaled_by == 0))
        self.active, self.gains = np.flatnonzero(band.active), tuple(gains)
        self.links = np.zeros((10 * y.shape[1], 0)) if links is None else links
        self.nuisance, self.usual_prior, self.scale = nuisance, 1.0 / nuisance_std**2, (1.0, 1.0)
        self._unchanged = nuisance

    @property
    def corrected(self) -> bool:
        """Whether rows are not those that were measured."""
        return self.y is not self.measured

    def correct(self, rows: FloatArray | None, links: FloatArray | None = None) -> None:
        """Add rows of shape (K, n) to those that were measured, and to the links' columns, shape (K, n, l); None: nothing."""
        self.y = self.measured if rows is None else self.measured + rows
        self.nuisance = self._unchanged
        if links is not None:
            self.nuisance = self._unchanged.copy()
            self.nuisance[:, :, -links.shape[2] :] += links

    @property
    def prior(self) -> FloatArray:
        """Inverse variance of the nuisance parameters before any data, shape (c,)."""
        return self.prior_of(self.scale)

    def prior_of(self, scale: tuple[float, float]) -> FloatArray:
        """The same with masses and places that are so inexact."""
        sizes = np.maximum([1.0, *scale], _EXACT)
        return np.asarray(self.usual_prior / sizes[self.scaled_by] ** 2)

    def blocks(self, terms: Sequence[Term], inexact: bool) -> tuple[dict[int, Block], int]:
        """Columns of each active joint, and the number of parameters."""
        index: dict[int, list[NDArray[np.intp]]] = {int(j): [] for j in self.active}
        columns: dict[int, list[FloatArray]] = {int(j): [] for j in self.active}
        start = 0
        for term in terms:
            where = np.arange(start, start + term.p)
            start += term.p
            for j in index if term.row is None else (term.row,):
                if j in index:
                    index[j].append(where)
                    columns[j].append(term.columns[:, j] if term.row is None else term.columns)
        if inexact:
            for j in index:
                index[j].append(np.arange(start, start + len(self.prior)))
                columns[j].append(self.nuisance[:, j])
            start += len(self.prior)
        nothing = np.zeros((len(self.y), 0))
        out = {}
        for j in index:
            out[j] = (
                np.concatenate([np.zeros(0, dtype=np.intp), *index[j]]),
                np.ascontiguousarray(np.concatenate([nothing, *columns[j]], axis=1)),
            )
        return out, start

    def fit(self, terms: Sequence[Term], noise: RowNoise | None = None, iterations: int = 3, inexact: bool = False) -> Fit:
        """The most likely parameters and noise, in turns.

        Args:
            noise: to start from, else that of the torque itself. inexact: leave the nuisance parameters free, within their usual
                size; the likelihood is then that of the rows for any values of theirs (marginal).
        """
        blocks, m = self.blocks(terms, inexact)
        count = m - (len(self.prior) if inexact else 0)
        prior = np.concatenate([np.zeros(0), *(term.prior for term in terms), self.prior if inexact else np.zeros(0)])
        noise = noise or self.band.noise_of(self.y)
        residual = self.y.copy()
        for turn in range(iterations + 1):
            variance = noise.along(self.band)
            information, score = np.diag(prior), np.zeros(m)
            root = 1.0 / np.sqrt(variance)
            for j, (index, X) in blocks.items():
                whitened = X * root[:, j, None]
                information[np.ix_(index, index)] += whitened.T @ whitened
                score[index] += whitened.T @ (self.y[:, j] * root[:, j])
            inverse = inverse_of(information)
            theta = inverse @ score
            for j, (index, X) in blocks.items():
                residual[:, j] = self.y[:, j] - X @ theta[index]
            # the last parameters are those of the noise that is kept: what a new term would gain depends on it
            if turn < iterations:
                noise = self.band.noise_of(residual)
        fit_quality = (self.band.counted * np.log(variance) + residual**2 / variance)[:, self.active]
        loglik = -0.5 * float(np.sum(fit_quality)) - 0.5 * float(theta**2 @ prior)
        if inexact:
            scaled, scale = scaled_to_one(information)
            both, own = np.linalg.slogdet(scaled)[1], np.linalg.slogdet(scaled[:count, :count])[1]
            loglik -= 0.5 * float(both - own - 2.0 * np.sum(np.log(scale[count:])) - np.sum(np.log(self.prior)))
        return Fit(tuple(terms), theta, inverse, noise, loglik, residual, blocks, variance, inexact, self.links)


def allowed(problem: Problem, fit: Estimated, term: Term) -> bool:
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
    noise = np.sum(fit.variance, axis=0) * problem.band.counted
    if not np.any(power > _SEEN**2 * nominal[rows]):
        return False
    if term.expected:
        return True
    floors = float(np.sum(power / noise[rows]))
    return floors > max(_FLOORS**2, _SEEN_OF_ALL**2 * float(np.sum(nominal[active] / noise[active])))
