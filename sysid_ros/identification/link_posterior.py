"""What the recordings and the URDF say of all parameters, and how far the URDF's links can be trusted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.identification.coloured_noise import coloured_information, root_of_covariance
from sysid_ros.identification.held_out import Solvers
from sysid_ros.identification.least_squares import Fit, residuals
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray

_TRIED = (*np.geomspace(1e-6, 1.0, 6, endpoint=False).tolist(), *np.geomspace(1.0, 1e5, 16).tolist(), 1e9)
"""Weights of the prior for all links alike; the last stands for links that are the URDF's, below 1 these only hold a place: of a
pendulum whose load nobody entered, by a factor of some hundred."""


_REPEATS = 2


@dataclass(frozen=True, slots=True)
class LinkPosterior:
    """Gaussian of the parameters after the data, with the prior's weight w at which the data are likeliest.

    Attributes:
        mean: shape (p,). covariance: shape (p, p). weight: w.
    """

    mean: FloatArray
    covariance: FloatArray
    weight: float


def link_posterior(bags: Sequence[BagRows], found: Fit, solvers: Solvers) -> LinkPosterior:
    """Empirical Bayes (MacKay 1992) with noise as coloured as the residuals are.

    With theta = mean + L^-T x, x of unit variance but for the links, whose is 1 / w, the score of the data is
    ``L^-1 (b - A mean) = M x + noise``, M = L^-1 A L^-T, and its noise has the covariance L^-1 S L^-T of the coloured residuals.
    Divided by the root of M in the directions that the data see, this is z = B x + n, and w maximises
    ``log N(z; 0, B V(w) B' + N)``.

    The residuals of a fit that is nearly free hold less than the noise in a short recording, more so if that is slow; so S is
    worked out again from the residuals of the posterior mean, with the leverage that is left.

    Args:
        bags, found: the recordings and the fit that their weights come from. solvers: prior of the links and of the rest.
    """
    score_covariance = found.bag_score_covariance.sum(axis=0)
    posterior = _likeliest(_Evidence(found, solvers, score_covariance))
    for _ in range(_REPEATS):
        root = root_of_covariance(_prior_precision(solvers, posterior.weight), found.information)
        score_covariance = np.zeros_like(score_covariance)
        for b, (bag, factor) in enumerate(zip(bags, found.rows, strict=True)):
            score_covariance += coloured_information(bag, residuals(bag, posterior.mean), factor * found.weight[b], root)[0]
        before, posterior = posterior.weight, _likeliest(_Evidence(found, solvers, score_covariance))
        if posterior.weight == before:
            break
    return posterior


def _prior_precision(solvers: Solvers, weight: float) -> FloatArray:
    """Inverse covariance of all parameters before the data, shape (p, p)."""
    is_link = solvers.prior.is_link
    precision: FloatArray = np.diag(np.where(is_link, 0.0, solvers.prior.precision()))
    return precision + weight * np.where(np.outer(is_link, is_link), solvers.curvature, 0.0)


class _Evidence:
    """z = B x + n, see :func:`link_posterior`."""

    def __init__(self, found: Fit, solvers: Solvers, score_covariance: FloatArray) -> None:
        self._is_link = solvers.prior.is_link
        self._mean: FloatArray = np.where(self._is_link, solvers.links, solvers.prior.mean)
        self._inverse: FloatArray = np.linalg.inv(np.linalg.cholesky(_prior_precision(solvers, 1.0)))
        L = self._inverse
        values, vectors = np.linalg.eigh(L @ found.information @ L.T)
        seen = values > TOL.seen
        root, directions = np.sqrt(values[seen]), vectors[:, seen]
        self._z = directions.T @ L @ (found.score - found.information @ self._mean) / root
        self._B = root[:, None] * directions.T
        noise = directions.T @ L @ score_covariance @ L.T @ directions / np.outer(root, root)
        values, vectors = np.linalg.eigh(0.5 * (noise + noise.T))
        self._noise = (vectors * np.maximum(values, TOL.least_noise)) @ vectors.T

    def _variance(self, weight: float) -> FloatArray:
        return np.where(self._is_link, 1.0 / weight, 1.0)

    def log_likelihood(self, weight: float) -> float:
        factor = np.linalg.cholesky(self._noise + (self._B * self._variance(weight)) @ self._B.T)
        white = np.linalg.solve(factor, self._z)
        return -0.5 * float(white @ white) - float(np.log(np.diag(factor)).sum())

    def posterior(self, weight: float) -> LinkPosterior:
        variance = self._variance(weight)
        gain = variance[:, None] * self._B.T
        total = self._noise + self._B @ gain
        mean = self._mean + self._inverse.T @ (gain @ np.linalg.solve(total, self._z))
        covariance = np.diag(variance) - gain @ np.linalg.solve(total, gain.T)
        return LinkPosterior(mean, self._inverse.T @ covariance @ self._inverse, weight)


def _likeliest(evidence: _Evidence) -> LinkPosterior:
    return evidence.posterior(max(_TRIED, key=evidence.log_likelihood))
