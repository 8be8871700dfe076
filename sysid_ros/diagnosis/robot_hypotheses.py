"""Whose torques they are: this URDF's, with its channels as they should be or with a fault, another robot's alike, or no robot's.

One family of hypotheses on the same rows, weighed by how likely they make torques of the half of the joint space that they have
not seen. What wins, with its probability, is what is undone, or why the recordings are refused.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sysid_ros.diagnosis.channel_faults import EffortFactors, Fault, effort_factors, fault_of_factors, faults_to_try
from sysid_ros.diagnosis.result import RankedUrdf
from sysid_ros.diagnosis.robot_kernels import CoarseRows, RobotKernels
from sysid_ros.diagnosis.robot_likelihood import (
    LEAVES,
    LEAVES_ALL,
    JointTorques,
    RowLikelihoods,
    halves,
    probabilities,
    row_likelihoods,
)
from sysid_ros.exceptions import DataError
from sysid_ros.input_gate.message_faults import in_order
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

_FAULT = 0.003
"""Probability of each kind of fault of the channels, before any data."""
_GRAVITY = {0.0: 0.978, -1.0: 0.02, 1.0: 0.002}
"""Probability that the efforts hold gravity as it is, not at all, or twice."""
_OTHER = 0.005
"""Probability that a URDF that somebody gives is that of another robot alike, or that the efforts are no torques of a robot."""
_CHANGES = 0.1
"""Probability that the payload changes in recordings, before any data."""
_LIKELY, _SURE = 0.5, 0.95
"""Probabilities from which a fault is likelier than not, and from which it is undone: what is undone wrongly spoils all that
comes after it, and what is left shows."""
_HOPELESS = 0.001
"""Probability below which nothing that is found later is waited for."""
_FAULTS = 3
"""Most faults that are looked for beside one another."""
_INEXACT = 0.03
"""What even a right URDF leaves of a torque, in a first comparison."""
_LEAST = 1e-3
"""Least size of an effort that is compared, of the largest."""
_COARSE, _TRIED = 3, 2
"""Each of so many rows for a first comparison, and how many hypotheses are compared on all of them."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """What recordings say of a URDF.

    Attributes:
        robot: the URDF's. faults: of the channels, in the order in which they are to be undone.
        urdf, free, no_robot: under each form of the URDF with its faults undone, with free bodies on the same joints and with no
            robot at all, their prior odds in it.
        factors: what was found of efforts with a factor of their own on each joint, where that is a fault.
        doubtful: whether another fault is likelier than not, and not sure enough to be undone.
    """

    robot: RobotModel
    faults: tuple[Fault, ...]
    urdf: RowLikelihoods
    free: RowLikelihoods
    no_robot: RowLikelihoods
    factors: EffortFactors | None = None
    doubtful: bool = False

    @property
    def probability(self) -> float:
        """That the torques are those of the URDF's robot: by all rows, rather than of other bodies on the same joints, and by
        those where the arm had not been before, the less."""
        by_all = probabilities([*self.urdf.whole, self.free.whole[0]])[:-1]
        unseen = probabilities([*self.urdf.then, self.free.then[0], self.no_robot.then[0]])[:-2]
        return float(min(by_all.sum(), unseen.sum()))

    def or_else(self, other: Judgement, part: float) -> Judgement:
        """The mixture with another one, which has a part of the prior probability."""
        own, its = np.array([np.log(1.0 - part)]), np.array([np.log(part)])
        urdf = self.urdf.plus(own).beside(other.urdf.plus(its))
        free = self.free.plus(own).beside(other.free.plus(its))
        return replace(self, urdf=urdf, free=free.only(free.best))

    @property
    def hopeless(self) -> bool:
        """Whether no cause that is found later could make it this URDF's robot, or these channels ones that hold a signal."""
        return self.probability < _HOPELESS or self.probability >= _LIKELY

    @property
    def refusal(self) -> str | None:
        """Why nothing can be said with this URDF, and the cure; None where something can."""
        if self.probability < _LIKELY:
            return self._of_another_robot()
        if self.factors is not None and not self.factors.seen.all():
            return self._without_signal(self.factors)
        return None

    def _of_another_robot(self) -> str:
        other = "functions of the joint angles that know no robot"
        if self.free.then.sum() > self.no_robot.then.sum():
            other = "the same joints with any other bodies on them"
        return (
            f"The URDF '{self.robot.name}' does not explain these torques (probability {self.probability:.2g}): {other} explain "
            "them better, above all where the arm had not been before, whatever friction, offset and payload are added to the "
            "URDF. It is another robot's URDF, or the efforts are no joint torques; give the URDF of the robot that was recorded "
            "(--urdf)."
        )

    def _without_signal(self, found: EffortFactors) -> str:
        names = self.robot.joint_names
        told = ", ".join(f"{names[j]} {found.values[j]:.3g} +- {found.std[j]:.1g}" for j in np.flatnonzero(found.seen))
        silent = ", ".join(names[j] for j in np.flatnonzero(~found.seen))
        return (
            f"The URDF '{self.robot.name}' does not explain these torques as they are: it is another robot's, or the efforts are "
            "in another unit than N m, with a factor of its own on each joint (torque_unit), as currents are"
            f"{f': {told}' if told else ''}. On {silent} they hold nothing of the links' torque, so that no factor can be told "
            "there: these channels are dead, or friction is all that they show. Give the URDF of the robot that was recorded "
            "(--urdf), publish joint torques in N m (current times torque constant and gear ratio), or leave these joints out "
            "(joint_names)."
        )


@dataclass(frozen=True, eq=False)
class _Trial:
    """Channels with some faults undone.

    Attributes:
        rows: as they are then. scale: log of what the faults publish of 1 N m, over all joints. silent: joints without a signal.
    """

    rows: CoarseRows
    kernels: RobotKernels
    scale: float
    log_prior: float
    silent: NDArray[np.bool_]
    fault: Fault | None = None
    factors: EffortFactors | None = None

    def coarse(self) -> float:
        """Roughly its log-likelihood: that of white noise beside the URDF's bodies and each joint's offset and friction."""
        tau, k, best = self.rows.tau, self.kernels, -np.inf
        for c in _GRAVITY:
            total = self.log_prior - len(tau) * self.scale
            for j in range(k.robot.n):
                X = np.stack([np.ones(len(tau)), self.rows.v[:, j], self.rows.sign[:, j]], axis=1)
                y = tau[:, j] - (0.0 if self.silent[j] else k.mean[:, j] + c * k.gravity[:, j])
                left = float(np.mean((y - X @ np.linalg.lstsq(X, y, rcond=None)[0]) ** 2))
                total -= 0.5 * len(tau) * np.log(left + (_INEXACT * float(np.std(tau[:, j]))) ** 2 + 1e-24)
            best = max(best, total)
        return best

    def likelihood(self, half: NDArray[np.bool_]) -> RowLikelihoods:
        """Of the published rows, with gravity as it is, not at all and twice, their priors in it."""
        tau, k = self.rows.tau, self.kernels
        usual = _usual(tau, self.silent)
        largest = float(usual[~self.silent].max()) if not self.silent.all() else 0.0
        joints = []
        for j in range(k.robot.n):
            forms = np.stack([tau[:, j] - k.mean[:, j] - c * k.gravity[:, j] for c in _GRAVITY], axis=1)
            prior = k.urdf(j, largest)
            if self.silent[j]:
                forms, prior = np.repeat(tau[:, [j]], len(_GRAVITY), axis=1), (0.0 * prior[0], 0.0 * prior[1])
            joints.append(JointTorques(forms, prior, k.own(j), k.pattern, float(usual[j])))
        return row_likelihoods(joints, half).plus(self.log_prior + np.log(list(_GRAVITY.values())) - len(tau) * self.scale)


def judge(robot: RobotModel, recordings: Sequence[Recording]) -> Judgement | None:
    """What recordings say of a URDF and of their channels; None where nothing of them can be used.

    A fault that is likely, and not sure, is undone only where nothing could be said of the recordings else.
    """
    rows = CoarseRows.of(robot, recordings)
    if rows is None:
        return None
    found = _judged(robot, rows, _SURE)
    return _judged(robot, rows, _LIKELY) if found.doubtful and found.refusal else found


def _judged(robot: RobotModel, rows: CoarseRows, sure: float) -> Judgement:
    """With the faults undone that have a probability."""
    half = halves(rows.q)
    trial = _Trial(rows, RobotKernels(robot, rows), 0.0, np.log(1.0 - 2.0 * _OTHER), np.zeros(robot.n, dtype=bool))
    found, faults, factors, doubtful = trial.likelihood(half), list[Fault](), None, False
    while len(faults) < _FAULTS:
        options = _first_choice(robot, trial)
        weighed = [(found, trial), *((option.likelihood(half), option) for option in options)]
        share = probabilities([x.likeliest for x, _ in weighed])
        best = int(np.argmax(share))
        # a fault that is real is no less likely than none where the arm had not been, whatever is usual
        unseen = [x.plus(np.array([-option.log_prior])).then[x.best] for x, option in (weighed[0], weighed[best])]
        probability = min(float(share[best]), float(probabilities(unseen)[1]))
        if best == 0 or probability < sure:
            doubtful = bool(best > 0 and probability >= _LIKELY)
            break
        found, trial = weighed[best]
        assert trial.fault is not None
        faults.append(replace(trial.fault, probability=probability))
        factors = trial.factors or factors
    first = replace(_judgement(trial, found, faults, factors, half), doubtful=doubtful)
    if first.probability >= _LIKELY:
        return first
    # what was carried may have been picked up or set down: seldom, and both alike explain more then
    changing = replace(trial, kernels=RobotKernels(robot, trial.rows, changes=True))
    return first.or_else(_judgement(changing, changing.likelihood(half), faults, factors, half), _CHANGES)


def _judgement(
    trial: _Trial, found: RowLikelihoods, faults: Sequence[Fault], factors: EffortFactors | None, half: NDArray[np.bool_]
) -> Judgement:
    given = found.plus(np.array([np.log(1.0 - 2.0 * _OTHER) - trial.log_prior]))  # other robots have the same faults here
    return Judgement(trial.kernels.robot, tuple(faults), given, *_others(trial, half), factors)


def _usual(tau: FloatArray, silent: NDArray[np.bool_]) -> FloatArray:
    """Usual effort of each joint, shape (n,), not so small that bodies shared with the largest would be lost in rounding."""
    size = np.sqrt(np.mean(tau**2, axis=0))
    return np.asarray(np.maximum(size, np.where(silent, 0.0, _LEAST * float(size.max())) + 1e-12))


def _others(trial: _Trial, half: NDArray[np.bool_]) -> tuple[RowLikelihoods, RowLikelihoods]:
    """Of the published rows with free bodies on the same joints, and with no robot."""
    k, rows = trial.kernels, trial.rows
    usual = _usual(rows.tau, trial.silent)
    odds = np.array([np.log(_OTHER) - len(rows.t) * trial.scale])
    nothing = 0.0 * k.free(0, 0.0)[0]
    out = []
    for free in (True, False):
        joints = []
        for j, u in enumerate(usual):
            prior = k.free(j, float(usual.max()))
            if not free or trial.silent[j]:
                prior = nothing, 0.0 * k.pattern
            leaves = LEAVES if free else LEAVES_ALL
            joints.append(JointTorques(rows.tau[:, [j]], prior, k.own(j), k.pattern, float(u), leaves))
        out.append(row_likelihoods(joints, half).plus(odds))
    return out[0], out[1]


def _first_choice(robot: RobotModel, trial: _Trial) -> list[_Trial]:
    """The likeliest faults on a few rows, roughly compared."""
    few = replace(trial, rows=trial.rows.every(_COARSE), kernels=RobotKernels(robot, trial.rows.every(_COARSE)))
    listed = list(faults_to_try(robot.joint_names))
    kinds = Counter(kind for kind, _ in listed)
    tried: list[tuple[float, Callable[[_Trial], _Trial]]] = []
    for kind, fault in listed:
        fault, prior = replace(fault, candidates=len(listed) + 1), float(np.log(_FAULT / kinds[kind]))
        undone = partial(_with, robot, fault=fault, log_prior=prior)
        tried.append((undone(few).coarse(), undone))
    if trial.factors is None:
        undone = partial(_with_factors, candidates=len(listed) + 1)
        tried.append((undone(few).coarse(), undone))
    return [undone(trial) for _, undone in sorted(tried, key=lambda x: -x[0])[:_TRIED]]


def _with_factors(trial: _Trial, candidates: int) -> _Trial:
    """The same with a factor of its own on each effort undone."""
    factors = effort_factors(trial.kernels, trial.rows.tau)
    option = _with(trial.kernels.robot, trial, fault_of_factors(factors, candidates), float(np.log(_FAULT)) + factors.log_prior)
    return replace(option, factors=factors, silent=~factors.seen)


def _with(robot: RobotModel, trial: _Trial, fault: Fault, log_prior: float) -> _Trial:
    """The same with one fault more undone."""
    rows = trial.rows.without(fault.effect)
    kernels = trial.kernels if np.array_equal(rows.q, trial.rows.q) else RobotKernels(robot, rows)
    factor = np.abs(fault.effect.publish(np.ones((1, robot.n))))
    scale = trial.scale + float(np.log(factor).sum())
    return replace(trial, rows=rows, kernels=kernels, scale=scale, log_prior=trial.log_prior + log_prior, fault=fault)


def rank_urdfs(robots: Sequence[RobotModel], names: Sequence[str], recordings: Sequence[Recording]) -> list[RankedUrdf]:
    """Probability that each of several URDFs with the same joints is that of the robot that was recorded, in their order.

    Raises:
        DataError: nothing of the recordings can be used, or the URDFs have different joints.
    """
    if len({robot.joint_names for robot in robots}) > 1:
        raise DataError("the URDFs name their joints differently: only those with the joints of the recordings can be compared.")
    ordered = [in_order(r)[0] for r in recordings]
    found = [x for robot in robots if (x := judge(robot, ordered)) is not None]
    if len(found) < len(robots):
        raise DataError(
            "the recordings hold no motion by which URDFs could be compared. Record 15 to 30 s in which every joint moves."
        )
    return [RankedUrdf(name, float(p)) for name, p in zip(names, probabilities([x.urdf.likeliest for x in found]), strict=True)]
