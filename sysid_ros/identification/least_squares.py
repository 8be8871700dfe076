"""Weighted least squares over rows with coloured noise, and the noise itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.estimators import LongRunVariance
from sysid_ros.identification.rows import BagRows
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Fit:
    """Parameters and their covariance, shape (p,) and (p, p), and the noise they were weighted with.

    Attributes:
        density: spectral density of the noise at zero frequency, a joint, shape (n,) [(N m)^2 s].
    """

    theta: FloatArray
    covariance: FloatArray
    density: FloatArray


def fit(bags: Sequence[BagRows], prior_mean: FloatArray, prior_std: FloatArray, iterations: int = 5) -> Fit:
    """``theta = argmin sum_j |Y_j theta - y_j|^2 / r_j + |(theta - prior) / std|^2``, the noise of each joint from its own
    residual.

    The noise r_j is the long-run variance of the residual, so rows that follow one another closely do not count as independent;
    the prior decides the directions that the data leave open.

    Args:
        bags: rows; those of joints that stand are left out.
        prior_mean, prior_std: shape (p,).
    """
    n = bags[0].y.shape[1]
    normal = np.zeros((n, prior_mean.size, prior_mean.size))
    score = np.zeros((n, prior_mean.size))
    for bag in bags:
        for j in range(n):
            Y, y = bag.Y[bag.moving[:, j], j], bag.y[bag.moving[:, j], j]
            normal[j] += bag.period * (Y.T @ Y)
            score[j] += bag.period * (Y.T @ y)
    prior = np.diag(1.0 / prior_std**2)
    density = np.full(n, 1.0)
    for _ in range(iterations):
        information = prior + np.einsum("j,jab->ab", 1.0 / density, normal)
        theta = np.linalg.solve(information, prior @ prior_mean + (score / density[:, None]).sum(axis=0))
        density = np.maximum(noise_density(bags, theta), 1e-12)
    covariance = np.linalg.inv(prior + np.einsum("j,jab->ab", 1.0 / density, normal))
    return Fit(theta, 0.5 * (covariance + covariance.T), density)


def residuals(bag: BagRows, theta: FloatArray) -> FloatArray:
    """y - Y theta, shape (N, n) [N m]."""
    return bag.y - bag.Y @ theta


def noise_density(bags: Sequence[BagRows], theta: FloatArray) -> FloatArray:
    """Spectral density of the residual at zero frequency, a joint, shape (n,) [(N m)^2 s], by batch means over moving rows.

    A joint that moves too little for batch means is taken to keep its error for half a second; 0 where it never moves.
    """
    n = bags[0].y.shape[1]
    total, seconds = np.zeros(n), np.zeros(n)
    for bag in bags:
        residual = residuals(bag, theta)
        for j in range(n):
            moving = residual[bag.moving[:, j], j]
            noise = LongRunVariance(1, bag.period, np.array([1e-12]), memory=1e9)
            for value in moving:
                noise.add(np.array([value]))
            density = (
                float(noise.variance[0]) * bag.period if noise.known else 0.5 * float(np.sum(moving**2)) / max(moving.size, 1)
            )
            total[j] += density * moving.size * bag.period
            seconds[j] += moving.size * bag.period
    return total / np.maximum(seconds, 1e-9)


def rms(values: FloatArray, where: np.ndarray[tuple[int, int], np.dtype[np.bool_]]) -> FloatArray:
    """Root mean square of each column over the rows that count, shape (n,)."""
    counts = np.maximum(where.sum(axis=0), 1)
    root: FloatArray = np.sqrt((np.where(where, values, 0.0) ** 2).sum(axis=0) / counts)
    return root
