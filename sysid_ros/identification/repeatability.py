"""What each bag says by itself: the spread between bags beside the spread that each of them claims."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.identification.base_groups import in_words
from sysid_ros.identification.free_effects import is_friction
from sysid_ros.identification.held_out import Prior
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.result import Repeatability
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray
from sysid_ros.torque.base_parameters import BaseParameters
from sysid_ros.torque.torque_model import TorqueModel


def per_bag(found: Fit, prior: Prior, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values and standard deviations of ``T theta`` as each bag alone gives them, shape (B, g) each, NaN where it can't tell."""
    precision = prior.precision()
    before = np.einsum("ga,a,ga->g", T, prior.std**2, T)
    values, stds = [], []
    for information, score, noise in zip(found.bag_information, found.bag_score, found.bag_score_covariance, strict=True):
        inverse = np.linalg.inv(information + np.diag(precision))
        covariance = inverse @ (noise + np.diag(precision)) @ inverse
        told = 1.0 - np.einsum("ga,ac,gc->g", T, inverse, T) / before >= TOL.determined
        value = T @ (inverse @ (score + precision * prior.mean))
        std = np.sqrt(np.maximum(np.einsum("ga,ac,gc->g", T, covariance, T), 0.0))
        values.append(np.where(told, value, np.nan))
        stds.append(np.where(told, std, np.nan))
    return np.array(values), np.array(stds)


def spread(values: FloatArray) -> FloatArray:
    """Standard deviation between bags of each column, shape (g,); NaN where fewer than two bags tell it."""
    told = np.isfinite(values)
    count = told.sum(axis=0)
    mean = np.where(told, values, 0.0).sum(axis=0) / np.maximum(count, 1)
    square = np.where(told, (values - mean) ** 2, 0.0).sum(axis=0) / np.maximum(count - 1, 1)
    deviation: FloatArray = np.where(count > 1, np.sqrt(square), np.nan)
    return deviation


def repeatability(
    model: TorqueModel, base: BaseParameters, T: FloatArray, values: FloatArray, stds: FloatArray
) -> tuple[Repeatability, ...]:
    """One entry for every base parameter that at least two bags tell by themselves, in the order of the model's parameters."""
    between = spread(values)
    rubs = [is_friction(effect) for effect in model.free for _ in range(effect.p)]
    out = []
    for g in np.argsort(base.independent):
        if math.isnan(between[g]):
            continue
        i = int(base.independent[g])
        terms = [(float(T[g, d]), model.parameter_names[d]) for d in sorted(base.dependent) if abs(T[g, d]) > TOL.rounding]
        told = np.isfinite(stds[:, g])
        out.append(
            Repeatability(
                name=in_words(model.parameter_names[i], terms),
                unit=model.units[i],
                values=tuple(values[:, g].tolist()),
                stds=tuple(stds[:, g].tolist()),
                between=float(between[g]),
                within=float(np.sqrt(np.mean(stds[told, g] ** 2))),
                friction=rubs[i],
            )
        )
    return tuple(out)
