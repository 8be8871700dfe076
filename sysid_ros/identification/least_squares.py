"""Least squares over rows with coloured noise, and the noise itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid_ros.estimators import LongRunVariance
from sysid_ros.identification.bag_sums import BagSums
from sysid_ros.identification.coloured_noise import coloured_information, root_of_covariance
from sysid_ros.identification.rows import BagRows, BoolArray
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.repetition import autocovariance

METHODS = ("ols", "wls", "irls", "robust")

_ITERATIONS = 10

_GAUSSIAN_BAND = 0.47
"""Of the Gaussian low-pass: white noise of density D has the variance D cutoff / 0.47 after it."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Parameters, how well they are known, and the noise they were weighted with, for B bags and n joints.

    Attributes:
        theta: shape (p,).
        covariance: honest for coloured residuals, shape (p, p). bound: the same, were they white with the same power.
        information, score: of the data alone, ``sum w Y' Y`` and ``sum w Y' y``, shape (p, p) and (p,).
        sums: sums over the rows of each bag.
        weight: w of a row, a bag and a joint, shape (B, n) [1/(N m)^2]. rows: factor of each row from the robust loss, a bag
            each, shape (N, n), 0 where it is not used.
        bag_information, bag_score, bag_score_covariance: of each bag, shape (B, p, p), (B, p) and (B, p, p).
        density: spectral density of the noise that the weights stand for, shape (B, n) [(N m)^2 s].
        level: noise variance of a row where the motion has its power, shape (B, n) [(N m)^2].
        squares: mean squared residual, shape (B, n) [(N m)^2].
    """

    theta: FloatArray
    covariance: FloatArray
    bound: FloatArray
    information: FloatArray
    score: FloatArray
    sums: BagSums
    weight: FloatArray
    rows: tuple[FloatArray, ...]
    bag_information: FloatArray
    bag_score: FloatArray
    bag_score_covariance: FloatArray
    density: FloatArray
    level: FloatArray
    squares: FloatArray


def fit(bags: Sequence[BagRows], prior_mean: FloatArray, prior_std: FloatArray, method: str = "irls") -> Fit:
    """``theta = argmin sum_bj w_bj |Y_bj theta - y_bj|^2 + |(theta - prior) / std|^2``.

    The weight w_bj of a bag and a joint is one over the long-run variance of its residual, so rows that follow one another
    closely do not count as independent; the prior decides the directions that the data leave open. With "ols" all joints and
    bags weigh alike, "wls" takes the noise from the residual of that, "irls" repeats it until it converges, "robust" also bounds
    what a single row can do (Huber 1964). The covariance is that of the weighted least squares under the noise as it is, see
    :func:`~sysid_ros.identification.coloured_noise.coloured_information`, and the prior's.

    Args:
        bags: rows; those of joints that stand are left out. prior_mean, prior_std: shape (p,). method: one of :data:`METHODS`.
    """
    rows = [bag.moving.astype(float) for bag in bags]
    sums = BagSums.of(bags, rows)
    periods = np.array([bag.period for bag in bags])[:, None]
    prior = np.diag(1.0 / prior_std**2)
    density = np.broadcast_to(np.ones(sums.count.shape[1]), sums.count.shape).copy()
    theta: FloatArray = prior_mean
    last_iteration = {"ols": 1, "wls": 1}.get(method, _ITERATIONS)
    for iteration in range(last_iteration + 1):
        weight: FloatArray = periods / density
        information: FloatArray = prior + sums.information(weight)
        last, side = theta, prior @ prior_mean + sums.right_side(weight)
        theta = np.asarray(np.linalg.solve(information, side), dtype=np.float64)
        moved = float(np.sum((theta - last) * (information @ (theta - last))))
        if iteration == last_iteration or (iteration > 2 and moved < TOL.converged):
            break
        if method == "robust":
            rows = [_huber(bag, residuals(bag, theta)) for bag in bags]
            sums = BagSums.of(bags, rows)
        found = np.array([noise_density(bag, theta, factor) for bag, factor in zip(bags, rows, strict=True)])
        known = found > 0.0
        if method == "ols":
            # one scale for all: it is only weighed against the prior
            found = np.full_like(found, float(found[known].mean()) if known.any() else 1.0)
        density = np.maximum(np.where(known, found, density), 1e-12)
    return _fit_with_noise(bags, theta, prior, sums, weight, rows, density)


def _fit_with_noise(
    bags: Sequence[BagRows],
    theta: FloatArray,
    prior: FloatArray,
    sums: BagSums,
    weight: FloatArray,
    rows: Sequence[FloatArray],
    density: FloatArray,
) -> Fit:
    """The parameters with the covariance that coloured residuals leave, and with that of white ones."""
    information = sums.information(weight)
    root = root_of_covariance(prior, information)
    inverse = root @ root.T
    score_covariance, level = np.zeros((len(bags), *information.shape)), np.zeros_like(density)
    for b, (bag, factor) in enumerate(zip(bags, rows, strict=True)):
        score_covariance[b], level[b] = coloured_information(bag, residuals(bag, theta), factor * weight[b], root)
    covariance = inverse @ (score_covariance.sum(axis=0) + prior) @ inverse
    squares = sums.squares(theta) / np.maximum(sums.count, 1.0)
    periods = np.array([bag.period for bag in bags])[:, None]
    band = np.array([_GAUSSIAN_BAND / bag.cutoff_hz for bag in bags])[:, None]
    white = periods / np.maximum(squares * band, 1e-14)
    bound = np.linalg.inv(prior + sums.information(white))
    return Fit(
        theta=theta,
        covariance=0.5 * (covariance + covariance.T),
        bound=0.5 * (bound + bound.T),
        information=information,
        score=sums.right_side(weight),
        sums=sums,
        weight=weight,
        rows=tuple(rows),
        bag_information=np.einsum("bj,bjac->bac", weight, sums.normal),
        bag_score=np.einsum("bj,bja->ba", weight, sums.score),
        bag_score_covariance=score_covariance,
        density=density,
        level=level,
        squares=squares,
    )


def residuals(bag: BagRows, theta: FloatArray) -> FloatArray:
    """y - Y theta, shape (N, n) [N m]."""
    return bag.y - bag.Y @ theta


def noise_density(bag: BagRows, theta: FloatArray, factor: FloatArray | None = None) -> FloatArray:
    """Spectral density of the residual at zero frequency, a joint, shape (n,) [(N m)^2 s], by batch means over moving rows.

    A joint that moves too little for batch means is taken to keep its error for half a second; 0 where it never moves.

    Args:
        factor: of each row, shape (N, n), in place of 1 where the joint moves.
    """
    residual, factor = residuals(bag, theta), bag.moving.astype(float) if factor is None else factor
    density = np.zeros(residual.shape[1])
    for j in range(len(density)):
        moving = (np.sqrt(factor[:, j]) * residual[:, j])[factor[:, j] > 0.0]
        noise = LongRunVariance(1, bag.period, np.array([1e-12]), memory=1e9)
        noise.add_all(moving[:, None])
        if noise.known:
            density[j] = float(noise.variance[0]) * bag.period
        elif moving.size:
            density[j] = TOL.unknown_memory * float(np.mean(moving**2))
        if bag.floats:
            # a few rows of a leg in the air may be followed exactly
            used = factor[:, j] > 0.0
            least = TOL.leg_error**2 * float(np.mean(bag.tau[used, j] ** 2)) if j >= FREE and used.any() else 0.0
            density[j] = max(density[j], least * TOL.unknown_memory) + _repeated(np.sqrt(factor[:, j]) * residual[:, j], bag)
    return density


def _repeated(residual: FloatArray, bag: BagRows) -> float:
    """Spectral density of an error that every step of a gait repeats, (N,) [(N m)^2 s]: what impacts do and no model says.

    It does not average out over steps. Its power P is the autocovariance at the gait's period L, as far as that is no chance; it
    is spread over the ``2 f L`` lines below the cut-off f, each as narrow as the recording is long.
    """
    count = len(residual)
    first, last = (round(x / bag.period) for x in TOL.step)
    last = min(last, count // 3)
    if last <= first:
        return 0.0
    covariance = autocovariance(residual[:, None], last)[:, 0]
    used = max(int(np.count_nonzero(residual)), 1)
    lag = first + int(np.argmax(covariance[first:]))
    power = float(covariance[lag]) - TOL.sure * float(covariance[0]) / used**0.5
    return float(max(power, 0.0)) * count / used * (count * bag.period) / max(2.0 * bag.cutoff_hz * lag * bag.period, 1.0)


def rms(values: FloatArray, where: BoolArray | None = None) -> FloatArray:
    """Root mean square of each column, shape (n,), over the rows that count (all by default)."""
    if where is None:
        where = np.ones(values.shape, dtype=np.bool_)
    counts = np.maximum(where.sum(axis=0), 1)
    return np.asarray(np.sqrt((np.where(where, values, 0.0) ** 2).sum(axis=0) / counts))


def _huber(bag: BagRows, residual: FloatArray) -> FloatArray:
    """Weight of each row, shape (N, n): 1 within 1.345 robust standard deviations (1.4826 times the median of the size)."""
    factor = bag.moving.astype(float)
    for j in range(residual.shape[1]):
        size = np.abs(residual[:, j])
        if not bag.moving[:, j].any():
            continue
        limit = TOL.huber * 1.4826 * float(np.median(size[bag.moving[:, j]]))
        factor[:, j] *= np.minimum(1.0, limit / np.maximum(size, 1e-12)) if limit > 0.0 else 1.0
    return factor
