"""Generalised least squares in the band, with the noise found together with the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.noise import Noise
from sysid_ros.diagnosis.term import Term, design
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, eq=False)
class Fit:
    """A set of terms with the parameters and the noise that make the rows the most likely.

    Attributes:
        terms: in the order of theta. theta: shape (m,), the nuisance parameters last.
        inverse: of the information, shape (m, m).
        noise: of each joint. loglik: of the rows, less what the nuisance parameters cost.
        residual: shape (K, n). whitened: columns over the noise's standard deviation, shape (K, n, m).
        variance: of the coefficients, shape (K, n).
        inexact: whether the nuisance parameters are free.
    """

    terms: tuple[Term, ...]
    theta: FloatArray
    inverse: FloatArray
    noise: Noise
    loglik: float
    residual: FloatArray
    whitened: FloatArray
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


class Problem:
    """The rows to explain.

    Args:
        band: the frequency domain. y: torque that the nominal model leaves, shape (K, n).
        nuisance: columns of what no model gets exactly right, shape (K, n, c). nuisance_std: their usual size, shape (c,).
    """

    def __init__(self, band: Band, y: FloatArray, nuisance: FloatArray, nuisance_std: FloatArray) -> None:
        self.band, self.y = band, y
        self.active = np.flatnonzero(band.active)
        self.nuisance, self.prior = nuisance, 1.0 / nuisance_std**2

    def fit(self, terms: list[Term], noise: Noise | None = None, iterations: int = 4, inexact: bool = False) -> Fit:
        """The most likely parameters and noise, in turns.

        Args:
            noise: to start from, else that of the residual of equal weights. inexact: leave the nuisance parameters free, within
                their usual size; the likelihood is then that of the rows for any values of theirs (marginal).
        """
        f, active = self.band.f, self.active
        K, n = self.y.shape
        terms_columns = design(terms, K, n)
        count = terms_columns.shape[2]
        X = np.concatenate([terms_columns, self.nuisance], axis=2) if inexact else terms_columns
        Xa, ya = np.ascontiguousarray(X[:, active]), self.y[:, active]
        m = X.shape[2]
        prior = np.concatenate([np.zeros(count), self.prior if inexact else np.zeros(0)])
        if noise is None:
            noise = Noise.of(f, self.y**2)
        for _ in range(iterations):
            variance = noise.variance(f)
            weight = 1.0 / np.sqrt(variance[:, active])
            W = (Xa * weight[:, :, None]).reshape(len(f) * len(active), m)
            z = (ya * weight).ravel()
            information = W.T @ W
            information[np.diag_indices(m)] += prior
            scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-30))
            scaled = information * scale[:, None] * scale
            scaled[np.diag_indices(m)] += 1e-9
            inverse = np.linalg.inv(scaled) * scale[:, None] * scale
            theta = inverse @ (W.T @ z)
            residual = self.y - X @ theta
            noise = Noise.of(f, residual**2)
        variance = noise.variance(f)
        loglik = -0.5 * float(np.sum((np.log(variance) + residual**2 / variance)[:, active])) - 0.5 * float(theta**2 @ prior)
        if inexact:
            both, own = np.linalg.slogdet(scaled)[1], np.linalg.slogdet(scaled[:count, :count])[1]
            loglik -= 0.5 * float(both - own - 2.0 * np.sum(np.log(scale[count:])) - np.sum(np.log(self.prior)))
        whitened = np.zeros_like(X)
        whitened[:, active] = Xa / np.sqrt(variance[:, active])[:, :, None]
        return Fit(tuple(terms), theta, inverse, noise, loglik, residual, whitened, variance, inexact)
