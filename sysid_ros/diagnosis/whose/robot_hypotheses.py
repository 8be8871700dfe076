"""Whose torques they are: this URDF's, with its channels as they should be or with a fault, another robot's alike, or no robot's.

One family of hypotheses on the same rows, weighed by how likely they make them. What wins, with its probability, is what is
undone, or why the recordings are refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from sysid_ros.diagnosis.channel_faults import (
    FAULT,
    EffortFactors,
    Fault,
    all_signs,
    one_factor,
)
from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.first_choice import COARSE, first_choice
from sysid_ros.diagnosis.whose.mount import Mount, mounted_otherwise, turned
from sysid_ros.diagnosis.whose.robot_kernels import Carried
from sysid_ros.diagnosis.whose.robot_likelihood import likeliest, probabilities
from sysid_ros.diagnosis.whose.robot_trial import Trial
from sysid_ros.effects.wording import listed
from sysid_ros.estimators.one_thread import on_one_thread
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.recording import Recording

_CARRIED = {Carried.SOMETHING: 0.45, Carried.NOTHING: 0.45, Carried.CHANGING: 0.1}
"""Probability of what is carried in recordings, before any data; the first is looked at first. An arm that carries nothing pays
for no payload."""
_LIKELY, _SURE = 0.5, 0.95
"""Probabilities from which a fault is likelier than not, and from which it is undone: what is undone wrongly spoils all that
comes after it, and what is left shows. So sure must a URDF be the robot's if some channels are not to speak against it."""
_DOUBTFUL, _WEIGHED_AGAIN = 0.1, 0.01
"""Probability of faults from which they are weighed again, with links that are exact but for one, and of one that is."""
_SIZED = 0.5
"""Probability that a robot of the URDF's kind has another size."""
_HOPELESS = 0.001
"""Probability below which nothing that is found later is waited for."""
_FAULTS = 3
"""Most faults that are looked for beside one another."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """What recordings say of a URDF.

    Attributes:
        robot: the URDF's. faults: of the channels, in the order in which they are to be undone.
        urdf, other_robots, no_robot: log-likelihood of each published row under each form of the URDF with its faults undone, and
            under other robots and none, with the same faults undone, some or none; priors are in them, shape (g, N) each.
        factors: what was found of efforts with a factor of their own on each joint, where that is a fault.
        doubtful: whether another fault is likelier than not, and not sure enough to be undone.
        mount: how the robot is mounted, where it is so otherwise than gravity was set; ``robot`` is under that.
    """

    robot: RobotModel
    faults: tuple[Fault, ...]
    urdf: FloatArray
    other_robots: FloatArray
    no_robot: FloatArray
    factors: EffortFactors | None = None
    doubtful: bool = False
    mount: Mount | None = None

    @property
    def probability(self) -> float:
        """That the torques are those of the URDF's robot, rather than of another robot or of none."""
        share = probabilities([*self.urdf, *self.other_robots, *self.no_robot])
        return float(share[: len(self.urdf)].sum())

    @property
    def hopeless(self) -> bool:
        """Whether no cause that is found later could make it this URDF's robot, or these channels ones that hold a signal.

        A fault of the channels and a cause that only the search knows are too many coincidences for a URDF that is unlikely.
        """
        return bool(self.faults) or self.probability < _HOPELESS or self.probability >= _LIKELY

    @property
    def refusal(self) -> str | None:
        """Why nothing can be said with this URDF, and the cure; None where something can.

        It must be likelier than not that the channels have the faults that are undone, and that the URDF is the robot's then.
        """
        few = 2 * len(self.silent) >= self.robot.n
        if self.factors is not None and (few or (self.silent and self.probability < _SURE)):
            return self._without_signal(self.factors)
        undone = float(np.prod([f.probability for f in self.faults if f.probability is not None]))
        return self._of_another_robot() if undone * self.probability < _LIKELY else None

    @property
    def silent(self) -> tuple[int, ...]:
        """Indices of the joints whose efforts hold nothing of the links' torque, in a unit of their own."""
        return () if self.factors is None else tuple(int(j) for j in np.flatnonzero(~self.factors.seen))

    @property
    def in_words(self) -> tuple[str, ...]:
        """What is to be said of the channels beside their faults."""
        if not self.silent:
            return ()
        where = listed([self.robot.joint_names[j] for j in self.silent])
        return (
            f"On {where} the efforts hold nothing of the links' torque, so that no factor of their unit can be told there, and "
            "nothing is said of these joints: the channels are dead, or friction is all that they show. Publish joint torques in "
            "N m (current times torque constant and gear ratio).",
        )

    def _of_another_robot(self) -> str:
        other = "functions of the joint angles that know no robot"
        if likeliest(self.other_robots).sum() > likeliest(self.no_robot).sum():
            other = "the same joints with other bodies on them"
        return (
            f"The URDF '{self.robot.name}' does not explain these torques (probability {self.probability:.2g}): {other} explain "
            "them better, whatever friction, offset and payload are added to the URDF. It is another robot's URDF, or the "
            "efforts are no joint torques; give the URDF of the robot that was recorded (--urdf)."
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


@on_one_thread
def judge(robot: RobotModel, recordings: Sequence[Recording]) -> Judgement | None:
    """What recordings say of a URDF and of their channels; None where nothing of them can be used.

    A fault that is likely, and not sure, is undone only where nothing could be said of the recordings else; but for another unit,
    which the gains that are left refute. It is no reason to refuse them.
    """
    rows = CoarseRows.of(robot, recordings)
    if rows is None:
        return None
    found = _of_channels(robot, rows)
    mount = mounted_otherwise(robot, rows)
    if mount is None and found.faults:
        mount = mounted_otherwise(robot, reduce(CoarseRows.without, [f.effect for f in found.faults], rows))
    if mount is not None:
        other = _of_channels(turned(robot, mount.gravity), rows)
        if p := _against(found, other, mount.log_prior):
            return replace(other, mount=mount._replace(probability=p))
    if found.refusal is None or robot.n == 1:
        return found
    fault = all_signs(robot.n)
    other = _of_channels(robot, rows.without(fault.effect))
    p = _against(found, other, float(np.log(FAULT)))
    return replace(other, faults=(replace(fault, probability=p), *other.faults)) if p else found


def _against(found: Judgement, other: Judgement, log_prior: float) -> float:
    """Probability of another judgement of a URDF, of the prior that what is told there has, against all that the first has; 0
    where it is not sure, or where that URDF is refused."""
    urdf = other.urdf + log_prior / other.urdf.shape[1]
    share = probabilities([likeliest(urdf), *(likeliest(x) for x in (found.urdf, found.other_robots, found.no_robot))])
    return 0.0 if share[0] < _SURE or other.refusal else float(share[0])


def _of_channels(robot: RobotModel, rows: CoarseRows) -> Judgement:
    found = _judged(robot, rows, _SURE, _SURE)
    if not found.doubtful:
        return found
    less_sure = _judged(robot, rows, _LIKELY if found.refusal else _SURE, _LIKELY)
    return found if less_sure.refusal else less_sure


def _judged(robot: RobotModel, rows: CoarseRows, sure: float, sure_of_units: float) -> Judgement:
    """With the faults undone that have a probability, and another unit that has one."""
    trial = published = Trial.of(robot, rows)
    urdf, faults, before, doubtful = trial.likelihood(), list[Fault](), list[Trial](), False
    factors: EffortFactors | None = None
    while len(faults) < _FAULTS:
        weighed = [(urdf, trial), *((x.likelihood(), x) for x in first_choice(robot, trial, any(map(_of_units, faults))))]
        factors = factors or next((x.factors for _, x in weighed if x.factors), None)
        share = probabilities([likeliest(x) for x, _ in weighed])
        if share[0] < 1.0 - _DOUBTFUL:
            share = _weighed_again(weighed, share)
        best = int(np.argmax(share))
        of_kind = _of_one_kind(best, [t.fault for _, t in weighed], share) if best > 0 else 0.0
        if of_kind < (sure_of_units if _of_units(weighed[best][1].fault) else sure):
            doubtful = of_kind >= _LIKELY
            break
        before.append(trial)
        urdf, trial = weighed[best]
        assert trial.fault is not None
        faults.append(replace(trial.fault, probability=of_kind))
    elsewhere = [trial, *before]
    if factors is not None and any(map(_of_units, faults)):
        elsewhere += _of_another_size(published, factors)
    robots, none = _other_robots(elsewhere), np.concatenate([x.of_no_robot() for x in elsewhere])
    first = Judgement(robot, tuple(faults), urdf, robots, none, trial.factors, doubtful)
    if first.probability >= _LIKELY:
        return first
    of_each = [(urdf, robots)]
    for carried in list(_CARRIED)[1:]:
        other = [x.carrying(carried) for x in elsewhere]
        of_each.append((other[0].likelihood(), _other_robots(other)))
    parts = np.log(list(_CARRIED.values())) / len(rows.t)
    urdf, robots = (np.concatenate([x + part for x, part in zip(xs, parts, strict=True)]) for xs in zip(*of_each, strict=True))
    return replace(first, urdf=urdf, other_robots=robots)


def _of_units(fault: Fault | None) -> bool:
    """Whether a fault is another unit of all efforts, which the gains that are left once all is found refute."""
    return fault is not None and bool(fault.effect.absorbs) and len(fault.joints) > 1


def _of_one_kind(best: int, faults: Sequence[Fault | None], share: FloatArray) -> float:
    """Probability of a fault with the others of its kind: that efforts are in another unit is as sure as one factor on all joints
    and a factor on each are together. Of one joint no factor is told from a body: there two of them are no surer than one.

    Args:
        best: which it is. faults: none first, shape (k,). share: probability of each, shape (k,).
    """
    found = faults[best]
    assert found is not None
    same = [
        i == best or (x and _of_units(x) and _of_units(found) and x.joints == found.joints) for i, x in enumerate(faults) if i
    ]
    return float(share[1:][np.array(same, dtype=bool)].sum())


def _weighed_again(weighed: Sequence[tuple[FloatArray, Trial]], share: FloatArray) -> FloatArray:
    """Probability of each fault, and of none first, with exact links and with nothing carried among the forms of those that have
    some probability. Whose robot it is exact links do not decide: a link that may be anything is a part of another robot."""
    again = [i for i, p in enumerate(share) if p > _WEIGHED_AGAIN or i == 0]
    out = np.zeros_like(share)
    out[again] = probabilities([likeliest(_every_form(*weighed[i])) for i in again])
    return out


def _every_form(urdf: FloatArray, trial: Trial) -> FloatArray:
    """Rows of a trial that carries something, which are given, or nothing, each with inexact and with exact links.

    What a payload explains of torques in another unit, the links explain of them as they are, without one: a fault that needs a
    payload is to be no likelier for what a payload that nobody needs costs.
    """
    nothing = trial.carrying(Carried.NOTHING)
    each = ((Carried.SOMETHING, trial, urdf), (Carried.NOTHING, nothing, nothing.likelihood()))
    forms = [np.concatenate([rows, _with_exact_links(x)]) + np.log(_CARRIED[c]) / rows.shape[1] for c, x, rows in each]
    return np.concatenate(forms)


def _with_exact_links(trial: Trial) -> FloatArray:
    """Rows with the URDF's links exact, or all but one: what is the likeliest on a few rows, roughly compared.

    One link that is far off is more usual than any fault of the channels, and looks like one of them to inexact links.
    """
    few, wrong = trial.every(COARSE), [None, *range(trial.kernels.robot.n)]
    return trial.exact(max(wrong, key=lambda link: few.exact(link).roughly())).likelihood()


def _other_robots(trials: Sequence[Trial]) -> FloatArray:
    return np.concatenate([x.of_other_robots() for x in trials])


def _of_another_size(published: Trial, factors: EffortFactors) -> list[Trial]:
    """Robots of one kind come in sizes: one factor on all torques, where they look like efforts in another unit."""
    if not factors.seen.any():
        return []
    fault, log_prior = one_factor(factors)
    sized = published.without(fault, float(np.log(_SIZED)) + log_prior)
    return [replace(sized, silent=~factors.seen, of_another_size=True)]
