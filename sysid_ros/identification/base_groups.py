"""The base parameters of a robot, in words, and what each bag says of them by itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sysid_ros.identification.free_effects import is_friction, place_of
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.result import BaseGroup, Parameter, Repeatability
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.base_parameters import BaseParameters
from sysid_ros.torque.torque_model import TorqueModel

_POSTURES = 600


def base_of_range(model: TorqueModel) -> BaseParameters:
    """The base of the free effects for motions all over the robot's range."""
    robot, random = model.robot, np.random.default_rng(0)
    bound = np.where(robot.is_prismatic, 1.0, np.pi)
    low, high = np.maximum(robot.position_lower, -bound), np.minimum(robot.position_upper, bound)
    speed = np.where(np.isfinite(robot.velocity_limit), robot.velocity_limit, np.where(robot.is_prismatic, 0.5, 2.0))
    information = np.zeros((model.p, model.p))
    for _ in range(_POSTURES):
        q, v = random.uniform(low, np.maximum(high, low)), speed * random.uniform(-1.0, 1.0, robot.n)
        columns, _ = model.split(Sample(0.0, q, v, 3.0 * speed * random.uniform(-1.0, 1.0, robot.n), np.zeros(robot.n)))
        information += columns.T @ columns
    return BaseParameters(information)


def group_matrix(base: BaseParameters) -> FloatArray:
    """T, shape (rank, p): base parameters are ``T theta``."""
    T = np.zeros((base.rank, len(base.independent) + len(base.dependent)))
    T[np.arange(base.rank), base.independent] = 1.0
    T[:, base.dependent] = base.combination
    return T


def base_groups(model: TorqueModel, base: BaseParameters, found: Fit, prior: Prior, between: FloatArray) -> tuple[BaseGroup, ...]:
    """Value, interval and words of every base parameter, in the order of the model's parameters.

    The values are those of the unconstrained fit: what the data say, before any body has to exist.

    Args:
        between: standard deviation of each base parameter between bags, shape (rank,), NaN where it is not known.
    """
    T = group_matrix(base)
    values = T @ found.theta
    std = np.sqrt(np.maximum(np.einsum("ga,ac,gc->g", T, found.covariance, T), 0.0))
    bound = np.sqrt(np.maximum(np.einsum("ga,ac,gc->g", T, found.bound, T), 0.0))
    posterior = np.linalg.inv(found.information + np.diag(prior.precision()))
    before = np.einsum("ga,a,ga->g", T, prior.std**2, T)
    from_data = np.clip(1.0 - np.einsum("ga,ac,gc->g", T, posterior, T) / before, 0.0, 1.0)
    out = []
    for g in np.argsort(base.independent):
        i = int(base.independent[g])
        terms = [(float(T[g, d]), model.parameter_names[d]) for d in sorted(base.dependent) if abs(T[g, d]) > TOL.rounding]
        out.append(
            BaseGroup(
                name=model.parameter_names[i],
                terms=tuple(terms),
                words=in_words(model.parameter_names[i], terms),
                value=float(values[g]),
                unit=model.units[i],
                std=float(std[g]),
                crb=float(bound[g]),
                ci95=(float(values[g] - 1.96 * std[g]), float(values[g] + 1.96 * std[g])),
                from_data=float(from_data[g]),
                determined_by=determined_by(float(from_data[g])),
                between_bags=float(between[g]),
            )
        )
    return tuple(out)


def in_words(name: str, terms: list[tuple[float, str]]) -> str:
    """``I_zz[b] + I_yy[a] - 0.4 mc_x[a]``."""
    words = name
    for coefficient, other in terms:
        size = "" if math.isclose(abs(coefficient), 1.0, rel_tol=1e-4) else f"{abs(coefficient):.4g} "
        words += f" {'-' if coefficient < 0.0 else '+'} {size}{other}"
    return words


def determined_by(from_data: float) -> str:
    """Where a parameter's value comes from, in words, by the part of its information that comes from the bags."""
    if from_data >= TOL.determined:
        return "bags"
    return "bags and prior" if from_data >= TOL.shared else "prior"


def per_bag(found: Fit, prior: Prior, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values and standard deviations of ``T theta`` as each bag alone gives them, shape (B, g) each, else NaN."""
    precision = prior.precision()
    before = np.einsum("ga,a,ga->g", T, prior.std**2, T)
    values, stds = [], []
    for information, score, noise in zip(found.bag_information, found.bag_score, found.bag_score_covariance, strict=True):
        inverse = np.linalg.inv(information + np.diag(precision))
        covariance = inverse @ (noise + np.diag(precision)) @ inverse
        known = 1.0 - np.einsum("ga,ac,gc->g", T, inverse, T) / before >= TOL.determined
        value = T @ (inverse @ (score + precision * prior.mean))
        std = np.sqrt(np.maximum(np.einsum("ga,ac,gc->g", T, covariance, T), 0.0))
        values.append(np.where(known, value, np.nan))
        stds.append(np.where(known, std, np.nan))
    return np.array(values), np.array(stds)


def widened(found: Fit, prior: Prior) -> Fit:
    """The fit with a covariance that holds by how much bags differ in what each of them determines by itself (Birge 1932).

    Of a robot on legs dry friction that sticks and what impacts leave are errors that do not average out within a bag; they are
    others in another gait.
    """
    from scipy.stats import chi2  # takes longer to load than the rest of the package

    values, stds = per_bag(found, prior, np.eye(len(prior.mean)))
    both = np.isfinite(values).all(axis=0)
    if len(values) < 2 or not both.any():
        return found
    weight = 1.0 / stds[:, both] ** 2
    mean = np.sum(weight * values[:, both], axis=0) / weight.sum(axis=0)
    squares = np.sum(weight * (values[:, both] - mean) ** 2, axis=0)
    # the median, because a bag may determine some of them by a few rows whose noise is not known
    ratio = float(np.median(squares) / chi2.median(len(values) - 1))
    return replace(found, covariance=max(ratio, 1.0) * found.covariance)


def spread(values: FloatArray) -> FloatArray:
    """Standard deviation between bags of each column, shape (g,); NaN where fewer than two bags determine it."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    mean = np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    square = np.where(known, (values - mean) ** 2, 0.0).sum(axis=0) / np.maximum(count - 1, 1)
    return np.asarray(np.where(count > 1, np.sqrt(square), np.nan))


def repeatability(
    model: TorqueModel, base: BaseParameters, T: FloatArray, values: FloatArray, stds: FloatArray
) -> tuple[Repeatability, ...]:
    """One entry for every base parameter that two bags or more determine by themselves, in the model's order."""
    between = spread(values)
    rubs = [is_friction(effect) for effect in model.free for _ in range(effect.p)]
    out = []
    for g in np.argsort(base.independent):
        if math.isnan(between[g]):
            continue
        i = int(base.independent[g])
        terms = [(float(T[g, d]), model.parameter_names[d]) for d in sorted(base.dependent) if abs(T[g, d]) > TOL.rounding]
        known = np.isfinite(stds[:, g])
        out.append(
            Repeatability(
                name=in_words(model.parameter_names[i], terms),
                unit=model.units[i],
                values=tuple(values[:, g].tolist()),
                stds=tuple(stds[:, g].tolist()),
                between=float(between[g]),
                within=float(np.sqrt(np.mean(stds[known, g] ** 2))),
                friction=rubs[i],
            )
        )
    return tuple(out)


def parameter_table(
    model: TorqueModel, theta: FloatArray, found: Fit, prior: Prior, between: Mapping[int, float]
) -> tuple[Parameter, ...]:
    """Every standard parameter with its interval.

    Args:
        theta: as found, shape (p,). between: standard deviation between bags of those that stand for a base parameter.
    """
    std, bound = np.sqrt(np.diag(found.covariance)), np.sqrt(np.diag(found.bound))
    posterior = np.diag(np.linalg.inv(found.information + np.diag(prior.precision())))
    out = []
    for effect, where in zip(model.free, model.slices, strict=True):
        for i in range(where.start, where.stop):
            name = model.parameter_names[i]
            out.append(
                Parameter(
                    name=name,
                    effect=effect.id,
                    joint=place_of(name),
                    value=float(theta[i]),
                    unit=model.units[i],
                    std=float(std[i]),
                    crb=float(bound[i]),
                    ci95=(float(theta[i] - 1.96 * std[i]), float(theta[i] + 1.96 * std[i])),
                    prior_std=float(prior.std[i]),
                    from_data=float(np.clip(1.0 - posterior[i] / prior.std[i] ** 2, 0.0, 1.0)),
                    between_bags=float(between.get(i, math.nan)),
                )
            )
    return tuple(out)


def condition_number(information: FloatArray, base: BaseParameters) -> float:
    """Of the base columns of these bags, each scaled to unit length; infinite where a column is zero."""
    part = information[np.ix_(base.independent, base.independent)]
    size = np.sqrt(np.diag(part))
    if np.any(size <= 0.0):
        return math.inf
    values = np.linalg.eigvalsh(part / np.outer(size, size))
    return float(np.sqrt(values[-1] / values[0])) if values[0] > 0.0 else math.inf
