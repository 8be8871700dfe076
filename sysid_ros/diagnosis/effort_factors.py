"""One factor on the effort of each joint: currents, per cent, torques of the motors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.robot_kernels import RobotKernels
from sysid_ros.diagnosis.robot_likelihood import USUAL, JointTorques, inverse
from sysid_ros.sample import FloatArray

_TURNS = 4
_BROAD = 10.0
"""Standard deviation of a factor over its last value: it is the data that tell it."""
_SPREAD, _APART = np.log(10.0), np.log(3.0)
"""Standard deviations of the logarithm of all factors together (per cent, amperes, counts), and of one joint's against them,
before any data."""


@dataclass(frozen=True, eq=False)
class EffortFactors:
    """What efforts say of a factor of their own on each joint.

    Attributes:
        values: published effort over torque, shape (n,); where none can be told the middle of the others. std: standard
            deviations. seen: joints whose efforts are likelier with the URDF's bodies in them than without any; of the others no
            factor can be told.
        log_prior: log-probability of such factors before any data: how narrowly each is told of what it could have been.
    """

    values: FloatArray
    std: FloatArray
    seen: NDArray[np.bool_]
    log_prior: float


def effort_factors(kernels: RobotKernels, tau: FloatArray) -> EffortFactors:
    """The factors with which the URDF's links, anything that the whole arm carries and what each joint has of its own make
    published efforts likeliest, shape (N, n)."""
    n, m = kernels.robot.n, kernels.mean
    size = np.maximum(np.sqrt(np.mean(tau**2, axis=0)), 1e-12)
    factors = size / np.maximum(np.sqrt(np.mean(m**2, axis=0)), 1e-12)
    sizes = [USUAL] * n
    for _ in range(_TURNS):
        joints = _joints(kernels, tau, factors, size / factors)
        covariance, theta = _posterior(joints, sizes)
        for j, x in enumerate(joints):
            sizes[j] = x.sizes(x.residual[:, 0] - x.prior[0] @ theta, x.fixed(), sizes[j])[0]
        gain = 1.0 + _BROAD * theta[:n]
        factors = factors * np.where(gain > 0.0, gain, 1.0)
    part = _BROAD * np.sqrt(np.diag(covariance)[:n]) / np.abs(gain)
    log_prior = _narrowly(np.log(factors), part)
    seen = np.zeros(n, dtype=bool)
    for j, x in enumerate(_joints(kernels, tau, factors, size / factors)):
        theta[:n] = 0.0
        without = x.sizes(tau[:, j] / factors[j], x.fixed() - x.prior[1])[1]
        with_bodies = x.sizes(x.residual[:, 0] - x.prior[0] @ theta, x.fixed(), sizes[j])[1]
        seen[j] = gain[j] > 0.0 and with_bodies + log_prior[j] > without
    if seen.any():
        factors = np.where(seen, factors, np.exp(np.median(np.log(factors[seen]))))
    return EffortFactors(factors, factors * part, seen, float(log_prior[seen].sum() + _together(np.log(factors[seen]))))


def _narrowly(logs: FloatArray, part: FloatArray) -> FloatArray:
    """Log-prior of each factor in the width to which it is told, shape (n,), against the middle of all."""
    z = (logs - np.median(logs)) / _APART
    return np.asarray(-0.5 * z**2 + np.minimum(np.log(part / _APART), 0.0))


def _together(logs: FloatArray) -> float:
    """Log-prior of what the factors that are told have in common, in the width to which it is."""
    if not logs.size:
        return 0.0
    return float(-0.5 * (np.mean(logs) / _SPREAD) ** 2 + np.log(_APART / np.sqrt(logs.size) / _SPREAD))


def _joints(kernels: RobotKernels, tau: FloatArray, factors: FloatArray, usual: FloatArray) -> list[JointTorques]:
    """Each joint's rows with a gain of its own among the parameters that all share."""
    out = []
    for j in range(kernels.robot.n):
        gains = np.zeros_like(tau)
        gains[:, j] = _BROAD * kernels.mean[:, j]
        whole, by_load = kernels.whole_arm(j, 0.0), kernels.by_load(j, 0.0)
        residual = tau[:, [j]] / factors[j] - kernels.mean[:, [j]]
        prior = np.concatenate([gains, whole], axis=1), by_load
        out.append(JointTorques(residual, prior, kernels.own(j), kernels.pattern, float(usual[j])))
    return out


def _posterior(joints: Sequence[JointTorques], sizes: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Covariance and mean of the parameters that all joints share, shapes (p, p) and (p,)."""
    p = joints[0].prior[0].shape[1]
    H, h = np.eye(p), np.zeros(p)
    for x, s in zip(joints, sizes, strict=True):
        own, side = x.information(inverse(x.covariance(s)))
        H, h = H + own, h + side
    scale = 1.0 / np.sqrt(np.diag(H))
    covariance = inverse(H * scale[:, None] * scale) * scale[:, None] * scale
    return covariance, covariance @ h
