"""Faults of units, signs and order: looked for first, since every other effect would soak them up; with their evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.evidence import Evidence
from sysid_ros.diagnosis.fit import Fit
from sysid_ros.diagnosis.prepare import Prepared
from sysid_ros.diagnosis.sets.block_scatter import BlockScatter
from sysid_ros.diagnosis.whose.robot_kernels import RobotKernels
from sysid_ros.diagnosis.whose.robot_likelihood import USUAL, JointTorques, inverse
from sysid_ros.effects import ChannelEffect, Channels, JointOrder, JointSign, TorqueSign, TorqueUnit
from sysid_ros.estimators.symmetric import inverse_of
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.whittle import Noise

UNITS = {
    1000.0: "N mm",
    100.0: "N cm",
    0.737562: "lbf ft",
    8.850746: "lbf in",
    0.001: "kN m",
    57.29578: "N m, times 180 / pi",
    0.101972: "kgf m",
}
"""Factors of units that efforts are published in by mistake."""
_TURNS = 4
_BROAD = 10.0
"""Standard deviation of a factor over its last value: it is the data that tell it."""
_SPREAD, _APART = np.log(10.0), np.log(3.0)
"""Standard deviations of the logarithm of all factors together (per cent, amperes, counts), and of one joint's against them,
before any data."""
_DEAD = 0.1
"""Probability that an effort in such a unit holds nothing of its joint's torque, before any data."""
_ROUNDS = 3
_SEEN = 1e-6
"""Part of a column that all others leave of it, from which its parameter is determined."""
Deviation = Callable[[Sequence[int], Sequence[int]], tuple[float, float] | None]
"""Of some joints, and others that have a factor of their own: by what part the efforts of the first are larger than the model's,
with its standard deviation."""


@dataclass(frozen=True)
class Fault:
    """A fault.

    Attributes:
        effect: how it is undone. joints: indices.
        values: (name, joint or None, value, unit, std) of each parameter; std is None where none was measured.
        parameters: free numbers among them. candidates: other faults that were tried, and itself.
        probability: that the channels have it, rather than another fault or none; None before it was weighed.
    """

    effect: ChannelEffect
    joints: tuple[int, ...]
    values: tuple[tuple[str, int | None, float | str, str, float | None], ...]
    parameters: int = 0
    candidates: int = 1
    probability: float | None = None


def undone(recording: Recording, faults: Sequence[Fault]) -> Recording:
    """The recording without some faults, undone in their order."""
    for fault in faults:
        channels = fault.effect.undo(Channels(recording.q, recording.v, recording.tau))
        recording = replace(recording, q=channels.q, v=channels.v, tau=channels.tau)
    return recording


def faults_to_try(names: Sequence[str]) -> Iterator[tuple[str, Fault]]:
    """With the kind of each: one effort, or joint, with the wrong sign; efforts, or all channels, of two swapped; one unit."""
    n = len(names)
    for j in range(n):
        yield "effort", Fault(TorqueSign([j]), (j,), (("gain", j, -1.0, "1", None),))
        yield "joint", Fault(JointSign([j]), (j,), (("sign", j, -1.0, "1", None),))
    for i, j in combinations(range(n), 2):
        source = np.arange(n)
        source[[i, j]] = j, i
        values = (("takes_from", i, names[j], "", None), ("takes_from", j, names[i], "", None))
        yield "efforts' order", Fault(JointOrder(source.tolist(), True), (i, j), values)
        yield "order", Fault(JointOrder(source.tolist(), False), (i, j), values)
    yield from faults_of_units(n)


def faults_of_units(n: int) -> Iterator[tuple[str, Fault]]:
    """One unit for all efforts."""
    for factor in UNITS:
        yield "unit", Fault(TorqueUnit([factor] * n), tuple(range(n)), (("factor", None, factor, "1", None),), 1)


def fault_of_factors(found: EffortFactors, candidates: int) -> Fault:
    """A factor of its own on each effort; those of efforts without a signal are not told."""
    values = tuple(("factor", int(j), float(found.values[j]), "1", None) for j in np.flatnonzero(found.seen))
    return Fault(TorqueUnit(found.values.tolist()), tuple(range(len(found.values))), values, len(values), candidates)


@dataclass(frozen=True, eq=False)
class EffortFactors:
    """What efforts say of a factor of their own on each joint.

    Attributes:
        values: published effort over torque, shape (n,); where none can be told the middle of the others. std: standard
            deviations. seen: joints whose efforts are likelier with the URDF's bodies in them than without any, and tell their
            factor; of the others none can be told.
        log_prior: log-probability of such factors before any data: how narrowly each is told of what it could have been.
    """

    values: FloatArray
    std: FloatArray
    seen: NDArray[np.bool_]
    log_prior: float


def one_factor(found: EffortFactors) -> tuple[Fault, float]:
    """What factors have in common as one factor on all efforts, and its log-probability before any data."""
    n, logs = len(found.values), np.log(found.values[found.seen])
    factor = float(np.exp(np.mean(logs)))
    return Fault(TorqueUnit([factor] * n), tuple(range(n)), (("factor", None, factor, "1", None),), 1), _together(logs)


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
        told = gain[j] > 0.0 and part[j] < _APART  # more narrowly than before any data
        seen[j] = told and with_bodies + log_prior[j] + np.log(1.0 - _DEAD) > without + np.log(_DEAD)
    if seen.any():
        factors = np.where(seen, factors, np.exp(np.median(np.log(factors[seen]))))
    log_prior = np.where(seen, log_prior + np.log(1.0 - _DEAD), np.log(_DEAD))
    return EffortFactors(factors, factors * part, seen, float(log_prior.sum() + _together(np.log(factors[seen]))))


def in_newton_metres(found: Sequence[tuple[float, float]], gain: float) -> float:
    """Probability that factors are those of efforts in N m and not in another unit, either as usual: by how much more they may be
    1 than before any data (the ratio of Savage and Dickey).

    Args:
        found: each factor with its standard deviation. gain: by what part gains of efforts in N m are off.
    """
    if not found or any(value <= 0.0 for value, _ in found):
        return 0.0
    logs, part = np.log([value for value, _ in found]), np.array([std / value for value, std in found])
    own, other = (0.5 * (logs / spread) ** 2 + np.log(spread) for spread in (np.hypot(part, gain), np.hypot(part, _APART)))
    return float(special.expit(np.sum(other - own)))


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
        takes = kernels.dissipated(j, float(usual[j]), by_load=True)
        out.append(JointTorques(residual, prior, kernels.own(j), kernels.pattern, float(usual[j]), takes))
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


def fault_evidence(robot: RobotModel, published: Sequence[Recording], faults: Sequence[Fault]) -> list[Evidence]:
    """Of each fault: how much likelier the published efforts are with it than without it, the others undone, where the URDF and
    each joint's own friction and offset predict them."""
    if not faults:
        return []
    whole, rows = _likelihood(robot, published, faults)
    out = []
    for fault in faults:
        without = _likelihood(robot, published, [f for f in faults if f is not fault])[0]
        out.append(Evidence(2.0 * (whole - without), fault.parameters, rows, fault.candidates))
    return out


def _likelihood(robot: RobotModel, published: Sequence[Recording], faults: Sequence[Fault]) -> tuple[float, float]:
    """Log-likelihood of the published efforts with some faults undone, and how many rows it is of."""
    factor = np.ones((1, robot.n))  # what the faults publish of 1 N m
    for fault in reversed(faults):
        factor = fault.effect.publish(factor)
    parts = [m for r in published for m in motions(robot, undone(r, faults))]
    band = Band(parts)
    y = band.rows([m.tau - m.link_torque for m in parts])
    out = 0.0
    for j in np.flatnonzero(band.active):
        X = band.joint_curves(int(j), [np.stack([smoothed_sign(m.v[:, j]), m.v[:, j], np.ones(len(m.t))]) for m in parts])
        residual = y[:, [j]]
        for _ in range(_ROUNDS):
            weighted = X / Noise.of(band.f, residual**2 / band.counted[j]).variance(band.f)
            residual = y[:, [j]] - X @ np.linalg.lstsq(weighted.T @ X, weighted.T @ y[:, [j]], rcond=None)[0]
        counted = float(band.counted[j])
        alike = residual / np.sqrt(counted)
        out += counted * Noise.of(band.f, alike**2).loglik(band.f, alike)
        out -= len(y) * counted * float(np.log(np.abs(factor[0, j])))
    return out, len(y) * float(np.sum(band.counted[band.active]))


def deviation_of(train: Prepared, fit: Fit) -> Deviation:
    """How far one factor on the efforts of some joints is from 1, all parameters of a fit and a factor of its own on each of some
    other joints adjusted to it: one step of Newton's.

    The standard deviation holds the scatter from one stretch of time to the next. None where the fit has that factor already."""
    root = 1.0 / np.sqrt(fit.variance)
    modelled = (train.band.rows([m.tau for m in train.motions]) - fit.residual) * root
    residual = fit.residual * root

    def deviation(joints: Sequence[int], beside: Sequence[int]) -> tuple[float, float] | None:
        of_each = np.zeros((1 + len(beside), fit.residual.shape[1]))  # which factor a joint has
        of_each[0, list(joints)] = 1.0
        of_each[range(1, len(of_each)), list(beside)] = 1.0
        of_each = of_each[:, list(fit.blocks)]
        of_each = of_each[[0, *np.flatnonzero(of_each[1:].any(axis=1)) + 1]]
        shared, own = np.zeros((len(fit.theta), len(of_each))), np.zeros(len(of_each))
        for (j, (index, X)), which in zip(fit.blocks.items(), of_each.T, strict=True):
            shared[index] += np.outer((X * root[:, j, None]).T @ modelled[:, j], which)
            own += which * float(np.sum(modelled[:, j] ** 2))
        adjusted = fit.inverse @ shared
        information = np.diag(own) - shared.T @ adjusted
        if not own[0] or information[0, 0] <= _SEEN * own[0]:
            return None
        variance = inverse_of(information)
        scatter, score = BlockScatter(train.band, len(own)), np.zeros(len(own))
        for (j, (index, X)), which in zip(fit.blocks.items(), of_each.T, strict=True):
            columns = modelled[:, j, None] * which - (X * root[:, j, None]) @ adjusted[index]
            score += columns.T @ residual[:, j]
            scatter.add(columns, residual[:, j], np.arange(len(own)))
        scattered = scatter.ratios(information)[0] * variance[0, 0]
        return float(variance[0] @ score), float(np.sqrt(scattered))

    return deviation
