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
from scipy import fft

from sysid_ros.diagnosis.band import Band, RowNoise
from sysid_ros.diagnosis.term import Term
from sysid_ros.estimators.symmetric import inverse_of, scaled_to_one
from sysid_ros.sample import FloatArray

Block = tuple[NDArray[np.intp], FloatArray]
"""Which parameters load a joint, and their columns there, shape (K, m_j)."""
_BLOCK = 1.5
"""Length of a block [s]: longer than what whitening leaves of a correlation."""
_MOST = 60
"""More blocks tell no more, and cost time."""
_KNOWN = 6.0
"""Blocks that are worth as much as what is known of such a ratio before any data: its mean is 1.5 then. Of the parameters of 16
robots of the level ``real`` 1.4 was the median and 1.9 the mean."""
_ALONE = 1e-6
"""Part of what is known of a parameter that the other blocks must tell: less is rounding."""
_SEEN = 0.012
"""Least part of the nominal residual (rms) that an effect must make on one of its joints."""
_SEEN_OF_ALL = 0.003
"""Least part of the nominal residual of all joints (rms, each over its noise), for effects that not every arm has."""
_FLOORS, _FLOORS_OF_NOISE = 0.4, 1.0
"""Least size (rms) of such an effect in noise floors, all joints together, and where its columns hold the noise themselves."""
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
        inexact: whether the nuisance parameters are free.
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
        considered: how many of them, the first ones, are no links': their size is always the usual one.

    Attributes:
        y: rows, corrected for what some causes change of the measured torque. measured: without that.
        scale: by how much more or less than usual masses, the first quarter of what no model gets right, and places are inexact.
    """

    def __init__(self, band: Band, y: FloatArray, nuisance: FloatArray, nuisance_std: FloatArray, considered: int = 0) -> None:
        self.band, self.y, self.measured, self.considered = band, y, y, considered
        self.active = np.flatnonzero(band.active)
        self.nuisance, self.usual_prior, self.scale = nuisance, 1.0 / nuisance_std**2, (1.0, 1.0)

    @property
    def corrected(self) -> bool:
        """Whether rows are not those that were measured."""
        return self.y is not self.measured

    def correct(self, rows: FloatArray | None) -> None:
        """Add rows of shape (K, n) to those that were measured; None: nothing."""
        self.y = self.measured if rows is None else self.measured + rows

    @property
    def prior(self) -> FloatArray:
        """Inverse variance of the nuisance parameters before any data, shape (c,)."""
        return self.prior_of(self.scale)

    def prior_of(self, scale: tuple[float, float]) -> FloatArray:
        """The same with masses and places that are so inexact."""
        links = np.arange(len(self.usual_prior) - self.considered)
        sizes = np.maximum(np.where(links < len(links) // 4, *scale), _EXACT)
        return np.asarray(self.usual_prior / np.concatenate([np.ones(self.considered), sizes]) ** 2)

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
        fit_quality = (np.log(variance) + residual**2 / variance)[:, self.active]
        loglik = -0.5 * float(np.sum(fit_quality)) - 0.5 * float(theta**2 @ prior)
        if inexact:
            scaled, scale = scaled_to_one(information)
            both, own = np.linalg.slogdet(scaled)[1], np.linalg.slogdet(scaled[:count, :count])[1]
            loglik -= 0.5 * float(both - own - 2.0 * np.sum(np.log(scale[count:])) - np.sum(np.log(self.prior)))
        return Fit(tuple(terms), theta, inverse, noise, loglik, residual, blocks, variance, inexact)


class BlockScatter:
    """Scores of the parameters of a fit, block by block.

    Args:
        band: of the rows. count: number of parameters m.
    """

    def __init__(self, band: Band, count: int) -> None:
        self._band = band
        length = max(_BLOCK, band.seconds / _MOST)
        lengths = [max(1, round((where.stop - where.start) * band.motions[i].period / length)) for i, where, _ in band.slices]
        self._first = np.concatenate([[0], np.cumsum(lengths)])
        self._scores = np.zeros((int(self._first[-1]), count))
        self._information = np.zeros((int(self._first[-1]), count, count))

    def add(self, columns: FloatArray, residual: FloatArray, index: NDArray[np.intp]) -> None:
        """Count in one joint.

        Args:
            columns: whitened, shape (K, p). residual: whitened, shape (K,). index: which parameters the columns belong to.
        """
        begin = 0
        for s, (_, _, count) in enumerate(self._band.slices):
            rows = slice(begin, begin + count)
            begin += count
            x, r = (fft.idct(part, axis=0, norm="ortho") for part in (columns[rows], residual[rows]))
            parts = np.array_split(np.arange(count), self._first[s + 1] - self._first[s])
            for b, part in enumerate(parts, int(self._first[s])):
                self._scores[b, index] += x[part].T @ r[part]
                self._information[b][np.ix_(index, index)] += x[part].T @ x[part]

    def ratios(self, information: FloatArray) -> FloatArray:
        """Variance with the scatter over the variance without, at least 1, shape (m,).

        Args:
            information: of all rows and before any data, shape (m, m).
        """
        return scatter_ratios(self._scores, self._information, information)


def scatter_ratios(scores: FloatArray, each: FloatArray, information: FloatArray) -> FloatArray:
    """As :meth:`BlockScatter.ratios` gives it, for scores of any blocks, shape (blocks, m).

    Each block counts as much as it tells of a parameter. A ratio is known from so many blocks as a variance is from so many
    values: the mean of its scaled inverse chi-squared distribution makes the parameter's variance that of Student's. What is
    known of a parameter before any data does not scatter.

    Args:
        each: information of each block, shape (blocks, m, m). information: as :meth:`BlockScatter.ratios` has it.
    """
    whole = inverse_of(information)
    variance = np.maximum(np.diag(whole), 1e-300)
    without = inverse_of(information - each)
    moved = np.einsum("bij,bj->bi", without, scores) ** 2
    told = np.maximum(np.einsum("ij,bjk,ki->bi", whole, each, whole, optimize=True), 0.0) / variance
    # (M - G)^-1 - M^-1 is M^-1 G M^-1 at least, but for rounding
    expected = np.maximum(np.diagonal(without, axis1=1, axis2=2) - variance, told * variance)
    total = np.maximum(told.sum(axis=0), 1e-300)
    told = np.where(_ALONE * expected < variance, told, 0.0)  # without it nothing is left that it could be compared with
    blocks = told.sum(axis=0) ** 2 / np.maximum(np.sum(told**2, axis=0), 1e-300)
    ratio = np.sum(told / np.maximum(expected, 1e-300) * moved, axis=0) / np.maximum(told.sum(axis=0), 1e-300)
    more = np.maximum((_KNOWN + blocks * ratio) / (_KNOWN + blocks - 2.0) - 1.0, 0.0)
    return np.asarray(1.0 + np.minimum(total, 1.0) * more)


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
    noise = np.sum(fit.variance, axis=0)
    if not np.any(power > _SEEN**2 * nominal[rows]):
        return False
    if term.expected:
        return True
    floors = float(np.sum(power / noise[rows]))
    least = _FLOORS_OF_NOISE if term.effect.from_measured else _FLOORS
    return floors > max(least**2, _SEEN_OF_ALL**2 * float(np.sum(nominal[active] / noise[active])))
