"""Faults of units, signs and order: looked for first, since every other effect would soak them up; with their evidence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from sysid_ros.diagnosis.band import Band
from sysid_ros.diagnosis.evidence import Evidence
from sysid_ros.diagnosis.whose.robot_kernels import RobotKernels
from sysid_ros.diagnosis.whose.robot_likelihood import USUAL, JointTorques, inverse
from sysid_ros.effects import ChannelEffect, Channels, JointOrder, JointSign, TorqueSign, TorqueUnit
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
_TURNS, _STEPS, _FURTHEST, _SETTLED = 3, 8, 1.0, 0.02
"""Rounds over the factors and the sizes of noise and discrepancy, most steps of the former in one, the longest, and one after
which they are settled."""
_SPREAD, _APART = np.log(10.0), np.log(3.0)
"""Standard deviations of the logarithm of all factors together (per cent, amperes, counts), and of one joint's against them,
before any data."""
FAULT, OWN_FACTORS = 0.003, 0.01
"""Probability of each kind of fault of the channels, before any data, and that efforts have a factor of their own on each joint:
currents, per cent and counts are what many drivers publish."""
_DEAD = 0.1
"""Probability that an effort in such a unit holds nothing of its joint's torque, before any data."""
_ROUNDS = 3


@dataclass(frozen=True)
class Fault:
    """A fault.

    Attributes:
        effect: how it is undone. joints: indices.
        values: (name, joint or None, value, unit) of each parameter.
        parameters: free numbers among them. candidates: other faults that were tried, and itself.
        probability: that the channels have it, rather than another fault or none; None before it was weighed.
        refined: whether its factors are those that all that was found left.
    """

    effect: ChannelEffect
    joints: tuple[int, ...]
    values: tuple[tuple[str, int | None, float | str, str], ...]
    parameters: int = 0
    candidates: int = 1
    probability: float | None = None
    refined: bool = False

    @property
    def own_factors(self) -> tuple[int, ...]:
        """Joints with a factor of their own, which the efforts told."""
        return self.joints if self.effect.absorbs and all(v[1] is not None for v in self.values) else ()


def undone(recording: Recording, faults: Sequence[Fault]) -> Recording:
    """The recording without some faults, undone in their order."""
    for fault in faults:
        channels = fault.effect.undo(Channels(recording.q, recording.v, recording.tau))
        recording = replace(recording, q=channels.q, v=channels.v, tau=channels.tau)
    return recording


def faults_to_try(names: Sequence[str]) -> Iterator[tuple[str, Fault]]:
    """With the kind of each: signs of one joint; efforts, or all channels, of two swapped; one unit."""
    n = len(names)
    yield from faults_of_signs(n, positions=False)
    for i, j in combinations(range(n), 2):
        source = np.arange(n)
        source[[i, j]] = j, i
        values = (("takes_from", i, names[j], ""), ("takes_from", j, names[i], ""))
        yield "efforts' order", Fault(JointOrder(source.tolist(), True), (i, j), values)
        yield "order", Fault(JointOrder(source.tolist(), False), (i, j), values)
    yield from faults_of_units(n)


def faults_of_signs(n: int, positions: bool) -> Iterator[tuple[str, Fault]]:
    """Of one joint: its effort, or all of its channels, with the wrong sign; ``positions``: or its position and velocity alone.

    On an arm what no model has, as a drag by the air, is now and then likelier with a wrist's position turned than with what is
    known; feet on the ground tell positions apart from efforts.
    """
    for j in range(n):
        yield "effort", Fault(TorqueSign([j]), (j,), (("gain", j, -1.0, "1"),))
        yield "joint", Fault(JointSign([j]), (j,), (("sign", j, -1.0, "1"),))
        if positions:
            values = (("sign", j, -1.0, "1"), ("sign_of_effort", j, 1.0, "1"))
            yield "joint", Fault(JointSign([j], efforts=False), (j,), values)


def all_signs(n: int) -> Fault:
    """All efforts with the wrong sign, as those with which the arm acts on its motors."""
    return Fault(TorqueSign(range(n)), tuple(range(n)), tuple(("gain", j, -1.0, "1") for j in range(n)))


def faults_of_units(n: int) -> Iterator[tuple[str, Fault]]:
    """One unit for all efforts."""
    for factor in UNITS:
        yield "unit", Fault(TorqueUnit([factor] * n), tuple(range(n)), (("factor", None, factor, "1"),), 1)


def fault_of_factors(found: EffortFactors, candidates: int) -> Fault:
    """A factor of its own on each effort; those of efforts without a signal are not told."""
    values = tuple(("factor", int(j), float(found.values[j]), "1") for j in np.flatnonzero(found.seen))
    return Fault(TorqueUnit(found.values.tolist()), tuple(range(len(found.values))), values, len(values), candidates)


@dataclass(frozen=True, eq=False)
class EffortFactors:
    """What efforts say of a factor of their own on each joint.

    Attributes:
        values: published effort over torque, shape (n,); where none can be told the middle of the others. std: standard
            deviations. seen: joints whose efforts are likelier with the URDF's bodies in them than as a dead channel; of
            the others no factor can be told.
        log_prior: log-probability of such factors before any data: how narrowly each is told of what it could have been.
    """

    values: FloatArray
    std: FloatArray
    seen: NDArray[np.bool_]
    log_prior: float


def one_factor(found: EffortFactors) -> tuple[Fault, float]:
    """What factors have in common as one factor on all efforts, and its log-probability before any data."""
    n, seen = len(found.values), found.seen
    part = (found.std / found.values)[seen]
    middle, width = float(np.median(np.log(found.values[seen]))), float(np.sum(part**-2.0) ** -0.5)  # one may be far off
    factor = float(np.exp(middle))
    log_prior = -0.5 * (middle / _SPREAD) ** 2 + np.log(width / _SPREAD) + _of_dead(seen)
    return Fault(TorqueUnit([factor] * n), tuple(range(n)), (("factor", None, factor, "1"),), 1), float(log_prior)


def _of_dead(seen: NDArray[np.bool_]) -> float:
    """Log-probability that these efforts hold something of their joints' torque, and the others nothing, before any data."""
    return float(np.sum(np.where(seen, np.log(1.0 - _DEAD), np.log(_DEAD))))


def usual_factors(n: int) -> FloatArray:
    """Covariance of the logarithms of n factors before any data, shape (n, n); their mean is 0."""
    return np.asarray(_SPREAD**2 * np.ones((n, n)) + _APART**2 * np.eye(n))


def effort_factors(kernels: RobotKernels, tau: FloatArray) -> EffortFactors:
    """The factors with which the URDF's inexact links, anything that the arm carries and what each joint has of its own make
    published efforts likeliest, shape (N, n), given what factors usually are (Gauss-Newton on their logarithms; what they cost is
    the integral about the likeliest, Laplace's method)."""
    n, m = kernels.robot.n, kernels.mean
    size = np.maximum(np.sqrt(np.mean(tau**2, axis=0)), 1e-12)
    over = size / np.maximum(np.sqrt(np.mean(m**2, axis=0)), 1e-12)
    logs, sizes = np.full(n, np.log(np.median(over))), [USUAL] * n
    before = usual_factors(n)
    known = inverse(before)
    for _ in range(_TURNS):
        for _ in range(_STEPS):
            joints = _joints(kernels, tau, np.exp(logs), size / np.exp(logs))
            covariance, theta = _posterior(joints, sizes, known, logs)
            moved = np.clip(theta[:n], -_FURTHEST, _FURTHEST)
            logs = logs + moved
            if np.all(np.abs(moved) < _SETTLED):
                break
        sizes = [x.sizes(x.residual[:, 0] - x.prior[0] @ theta, x.fixed(), s)[0] for x, s in zip(joints, sizes, strict=True)]
    factors, of_each = np.exp(logs), covariance[:n, :n]
    part, unusual = np.sqrt(np.diag(of_each)), known @ logs
    narrow = 0.5 * np.log(np.diag(of_each) * np.diag(known)) - 0.5 * unusual**2 / np.diag(known)
    seen = np.zeros(n, dtype=bool)
    for j, x in enumerate(_joints(kernels, tau, factors, size / factors)):
        theta[:n] = 0.0
        without = x.sizes(tau[:, j] / factors[j], x.fixed() - x.prior[1])[1]
        with_bodies = x.sizes(x.residual[:, 0] - x.prior[0] @ theta, x.fixed(), sizes[j])[1]
        seen[j] = with_bodies + narrow[j] + np.log(1.0 - _DEAD) > without + np.log(_DEAD)
    if seen.any():
        factors = np.where(seen, factors, np.exp(np.median(logs[seen])))
    at, told = np.ix_(seen, seen), logs[seen]
    width = 0.5 * float(np.linalg.slogdet(of_each[at])[1] - np.linalg.slogdet(before[at])[1])
    log_prior = width - 0.5 * float(told @ np.linalg.solve(before[at], told)) + _of_dead(seen)
    return EffortFactors(factors, factors * part, seen, log_prior)


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


def _joints(kernels: RobotKernels, tau: FloatArray, factors: FloatArray, usual: FloatArray) -> list[JointTorques]:
    """Each joint's rows with a gain of its own among the parameters that all share."""
    out = []
    for j in range(kernels.robot.n):
        gains = np.zeros_like(tau)
        gains[:, j] = kernels.mean[:, j]
        bodies, by_load = kernels.urdf(j, 0.0)
        residual = tau[:, [j]] / factors[j] - kernels.mean[:, [j]]
        prior = np.concatenate([gains, bodies], axis=1), by_load
        takes = kernels.dissipated(j, float(usual[j]), by_load=True)
        out.append(JointTorques(residual, prior, kernels.own(j), kernels.pattern, float(usual[j]), takes))
    return out


def _posterior(
    joints: Sequence[JointTorques], sizes: Sequence[FloatArray], known: FloatArray, logs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Covariance and mean of the parameters that all joints share, shapes (p, p) and (p,); the first are by how much the logs of
    the factors are more than ``logs``, whose information before any data is ``known`` about 0."""
    p, n = joints[0].prior[0].shape[1], len(logs)
    H, h = np.eye(p), np.zeros(p)
    H[:n, :n], h[:n] = known, -known @ logs
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


def mount_evidence(robot: RobotModel, level: RobotModel, published: Sequence[Recording], faults: Sequence[Fault]) -> Evidence:
    """The same of the direction of gravity that ``robot`` has, against that of ``level``."""
    whole, rows = _likelihood(robot, published, faults)
    return Evidence(2.0 * (whole - _likelihood(level, published, faults)[0]), 2, rows, 1)


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
