"""Alarms: which of the changes that may be there are told, so that of those that are told few are none.

Looks at n joints and tips give e-values e_1 .. e_n. Told are the k largest, k the greatest number for which the k-th is at least
``n / (k rate)`` (e-BH: Wang, Ramdas 2022): the expected share of false ones among what is told is then at most ``rate``, however
robots, joints and looks depend on each other, with seasons and programs in common as they have.

Beside it stands the probability of each, with the share of looks that show a change as the likelihood of all looks has it (local
false-discovery rate: Efron 2010, ch. 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from sysid_ros.fleet.changes.candidates import Candidate
from sysid_ros.fleet.changes.fleet_changes import FleetChanges
from sysid_ros.fleet.changes.quantities import QUANTITIES, Costs
from sysid_ros.fleet.changes.series import RobotSeries

RATE = 0.05
"""Of false discoveries among what is told."""


@dataclass(frozen=True, eq=False, slots=True)
class Alarm:
    """A change that is told.

    Attributes:
        change: what. probability: that something changed there. of_kind: that it is this, given that. cannot_be_told_from:
            quantities that share the probability. what, cost, look: in words. before, after: paths of the bags beside it.
    """

    change: Candidate
    probability: float
    of_kind: float
    cannot_be_told_from: tuple[str, ...]
    what: str
    cost: str
    look: str
    before: tuple[str, ...]
    after: tuple[str, ...]


_BESIDE = 5
"""Bags before and after an alarm that are linked."""
_SHARED = 0.1
"""Probability from which another quantity is named beside the likeliest."""


def limit_of(looks: Sequence[float], rate: float) -> float:
    """Logarithm of the e-value from which looks are told at a rate of false discoveries (e-BH); infinite where none is."""
    e = sorted(looks, reverse=True)
    limits = [np.log(len(e)) - np.log(k * rate) for k in range(1, len(e) + 1)]
    return min((value for value, limit in zip(e, limits, strict=True) if value >= limit), default=np.inf)


def told(changes: FleetChanges, rate: float = RATE, beside: Sequence[float] = ()) -> tuple[Candidate, ...]:
    """The candidates that are told at a rate of false discoveries, where looks ``beside`` these are judged with them."""
    limit = limit_of([*changes.looks, *beside], rate)
    return tuple(c for c in changes.candidates if c.log_e >= limit)


def alarms(changes: FleetChanges, rate: float = RATE, beside: Sequence[float] = ()) -> tuple[Alarm, ...]:
    """What is told, in words, the surest first."""
    share = changed_share([*changes.looks, *beside])
    robots = {r.name: r for r in changes.series.robots}
    return tuple(_alarm(c, share, robots[c.robot]) for c in told(changes, rate, beside))


def percent(p: float) -> str:
    """A probability as people read it; what rounds to all is said to be more than the last that does not."""
    return "> 99.9 %" if p > 0.999 else f"{100.0 * p:.3g} %"


def changed_share(looks: Sequence[float]) -> float:
    """Share of looks that show a change, from the logarithms of their e-values: where the likelihood of all is greatest."""
    e = np.asarray(looks)
    share = 0.1 if e.size else 0.0
    for _ in range(200):
        share = float(np.mean(_probability(e, share))) if share > 0.0 else 0.0
    return share


def probability_of(log_e: float, share: float) -> float:
    """That something changed, by the logarithm of its e-value and the share of looks that show a change."""
    return float(_probability(np.array([log_e]), share)[0])


def _probability(
    log_e: np.ndarray[tuple[int, ...], np.dtype[np.float64]], share: float
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    if not 0.0 < share < 1.0:
        return np.full(np.shape(log_e), float(share))
    return np.asarray(expit(log_e + np.log(share) - np.log1p(-share)))


def _alarm(change: Candidate, share: float, robot: RobotSeries) -> Alarm:
    of = QUANTITIES[change.quantity]
    grew = change.size > 0.0
    where = f" of {change.joint}" if change.joint else ""
    what = f"{of.words}{where} {'+' if grew else '-'}{abs(change.size) * of.factor:.2g} {of.unit}"
    early, late = change.since[1], max(change.since[2], change.since[0] + change.length)
    before = [bag for bag, day in zip(robot.bags, robot.days, strict=True) if day <= early]
    after = [bag for bag, day in zip(robot.bags, robot.days, strict=True) if day >= late]
    others = tuple(name for name, p in change.kinds.items() if name != change.quantity and p > _SHARED)
    return Alarm(
        change,
        probability_of(change.log_e, share),
        change.kinds[change.quantity],
        others,
        what,
        of.cost(change.size, _costs(change, robot)),
        of.look,
        tuple(before[-_BESIDE:]),
        tuple(after[:_BESIDE]),
    )


def _costs(change: Candidate, robot: RobotSeries) -> Costs:
    """Of the joint that changed; of what is carried, those of the joint which it costs most."""
    if change.joint:
        return next(s.costs for s in robot.joints if s.joint == change.joint)
    return max((s.costs for s in robot.joints), key=lambda costs: costs.per_mass or 0.0)
