"""fleet_changes: every joint of every robot is looked at, twice: what its kind shares is learned again once changes are known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from sysid_ros.fleet.changes.candidates import Candidate, Found, candidates_of, found_carried, found_in
from sysid_ros.fleet.changes.carried import carried_evidence, scatter_of
from sysid_ros.fleet.changes.covariances import covariance_of, expected, one_bag, trend
from sysid_ros.fleet.changes.evidence import JointEvidence, Shapes, shapes
from sysid_ros.fleet.changes.levels import in_levels, levels
from sysid_ros.fleet.changes.pooled import OneSeries, Pooled, pooled
from sysid_ros.fleet.changes.series import FleetSeries, RobotSeries, Series
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.sample import FloatArray

_WORTH = np.log(3.0)
"""Logarithm of the e-value from which a change is taken as known while another is looked for: 3 to 1 is worth a mention (Kass,
Raftery 1995). Alarms need far more."""
_MOST_CHANGES, _MOST_ODD = 4, 0.15
"""Changes of one joint; odd bags as a part of all."""
_YEAR = 365.25


@dataclass(frozen=True, eq=False, slots=True)
class JointHistory:
    """A joint over time, as it is shown: days (N,), level and its std (N, 8), index of odd bags."""

    robot: str
    joint: str
    series: Series
    days: FloatArray
    level: FloatArray
    level_std: FloatArray
    odd: tuple[int, ...]


@dataclass(frozen=True, eq=False, slots=True)
class FleetChanges:
    """All that was looked at.

    Attributes:
        series: what it was looked for in. candidates: what may have changed. looks: the logarithm of the e-value of every look,
            also of those that found nothing. histories: of every joint. pooled: by kind, joint and parameter, in units of the
            robots' own :mod:`.levels`.
    """

    series: FleetSeries
    candidates: tuple[Candidate, ...]
    looks: tuple[float, ...]
    histories: tuple[JointHistory, ...]
    pooled: dict[tuple[str, str], tuple[Pooled, ...]]


@dataclass(slots=True)
class _Joint:
    """One joint while it is worked on: ``series`` is in units of ``level`` (8,), ``course`` too."""

    robot: RobotSeries
    told: Series
    series: Series
    level: FloatArray
    days: FloatArray
    x: FloatArray
    course: FloatArray
    odd: list[int]


def fleet_changes(series: FleetSeries, said: Callable[[str], None] = lambda s: None) -> FleetChanges:
    """What changed in a fleet. ``said`` is told what is being done."""
    kinds: dict[tuple[str, str], list[_Joint]] = {}
    for robot in series.robots:
        for of in robot.joints:
            days = robot.days[of.bags]
            entry = _Joint(robot, of, of, np.ones(len(JOINT_PARAMETERS)), days, np.zeros((len(days), 0)), np.zeros_like(of.y), [])
            kinds.setdefault((robot.kind, of.joint), []).append(entry)
    everything: list[Found] = []
    looks: list[float] = []
    shared: dict[tuple[str, str], tuple[Pooled, ...]] = {}
    known: dict[bytes, Shapes] = {}
    for number, (key, joints) in enumerate(kinds.items(), start=1):
        said(f"Joint {key[1]} of {key[0]} ({number} of {len(kinds)})")
        _covariates(joints)
        for joint, level in zip(joints, levels([j.told for j in joints]), strict=True):
            joint.level, joint.series = level, in_levels(joint.told, level)
        rounds = []
        for robust in (True, False):
            shared[key] = tuple(_pooled(joints, p, robust) for p in range(len(JOINT_PARAMETERS)))
            rounds.append([_looked_at(joint, shared[key], known) for joint in joints])
        for first, (some, e) in zip(*rounds, strict=True):
            capped = [_capped(f, first) for f in some]
            everything += [f for f in capped if f.log_e > _WORTH]
            looks += [*(f.log_e for f in capped), *e[len(some) :]]
    said("What the robots carry")
    scatter = scatter_of(series.robots)
    for robot in series.robots:
        evidence = carried_evidence(robot, scatter)
        if evidence is not None:
            looks.append(evidence.log_e)
            if evidence.log_e > _WORTH:
                everything.append(found_carried(robot.name, evidence))
    histories = tuple(_history(j, shared[key]) for key, joints in kinds.items() for j in joints)
    candidates = sorted(candidates_of(everything), key=lambda c: -c.log_e)
    return FleetChanges(series, tuple(candidates), tuple(looks), histories, shared)


def _capped(found: Found, first: tuple[list[Found], list[float]]) -> Found:
    """The change with no more evidence than in the first round. In the second the scatter is what is left beside the changes of
    the first: where one robot with few bags tells it, that speaks for them."""
    before = [f.log_e for f in first[0] if f.quantity == found.quantity]
    return replace(found, log_e=min(found.log_e, max(before, default=first[1][-1])))


def _covariates(joints: Sequence[_Joint]) -> None:
    """Temperature where every bag tells it, the season where not, and the load; of mean 0 and variance 1 over the kind."""
    heat = np.concatenate([j.series.temperature for j in joints])
    for j in joints:
        season = 2.0 * np.pi * j.days / _YEAR
        warm = [j.series.temperature] if np.isfinite(heat).all() else [np.cos(season), np.sin(season)]
        load = j.robot.mass[j.series.bags]
        usual = np.median(load[np.isfinite(load)]) if np.isfinite(load).any() else 0.0
        j.x = np.column_stack([*warm, np.where(np.isfinite(load), load, usual)])
    whole = np.concatenate([j.x for j in joints])
    mean, std = whole.mean(axis=0), whole.std(axis=0)
    for j in joints:
        j.x = np.where(std > 0.0, (j.x - mean) / np.where(std > 0.0, std, 1.0), 0.0)


def _pooled(joints: Sequence[_Joint], p: int, robust: bool) -> Pooled:
    some = []
    for j in joints:
        y = j.series.y[:, p] - j.course[:, p]
        y[j.odd] = np.nan
        some.append(OneSeries(j.days, y, j.series.covariance[:, p, p], j.x))
    return pooled(some, robust)


def _looked_at(joint: _Joint, shared: Sequence[Pooled], known: dict[bytes, Shapes]) -> tuple[list[Found], list[float]]:
    """Changes of a joint, one after the other, and the evidence of every look."""
    if (key := joint.days.tobytes()) not in known:
        known[key] = shapes(joint.days)
    courses = known[key]
    model = JointEvidence(
        joint.series.y - expected(joint.x, shared),
        covariance_of(joint.series, joint.days, joint.x, shared),
        one_bag(joint.series, shared),
        courses,
    )
    joint.course, joint.odd = np.zeros_like(joint.series.y), []
    found: list[Found] = []
    looks: list[float] = []
    while len(found) < _MOST_CHANGES:
        look = model.look()
        if look.log_odd > max(float(logsumexp(look.log_of)), _WORTH) and len(joint.odd) < _MOST_ODD * len(joint.days):
            joint.odd.append(model.take_odd(look))
            continue
        looks.append(look.log_e)
        if not look.log_e > _WORTH:
            break
        best = int(np.argmax(look.log_of))
        chance = np.exp(look.log_of - logsumexp(look.log_of))
        kinds = {name: float(c) for name, c in zip(JOINT_PARAMETERS, chance, strict=True)}
        one = found_in(joint.robot.name, joint.series.joint, look, best, kinds, courses)
        found.append(replace(one, size=joint.level[best] * one.size, square=joint.level[best] ** 2 * one.square))
        joint.course[:, best] += model.take(look, best)
    return found, looks


def _history(joint: _Joint, shared: Sequence[Pooled]) -> JointHistory:
    y = joint.series.y.copy()
    y[joint.odd] = np.nan
    trends = [
        trend(y[:, p], joint.series.covariance[:, p, p], joint.days, joint.x, of, joint.course[:, p])
        for p, of in enumerate(shared)
    ]
    level, std = (joint.level * np.column_stack(part) for part in zip(*trends, strict=True))
    return JointHistory(joint.robot.name, joint.series.joint, joint.told, joint.days, level, std, tuple(joint.odd))
