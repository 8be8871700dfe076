"""The base parameters of a robot, in words: which parameters are lumped with which."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.result import BaseGroup
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
