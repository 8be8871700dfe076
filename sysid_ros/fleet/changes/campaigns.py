"""Campaigns: bags of which nobody knows the date, but which were recorded together; what differs between campaigns.

A parameter of a joint is, over bags b of campaign k::

    y_b = mean + c_k + e_b,     e_b ~ N(0, stated variance of the bag + scatter),     c_k ~ N(0, A^2)

The scatter from bag to bag is not known. It has the prior that a fleet's trends have (:mod:`.pooled`), and is summed over, so
that a handful of bags gives a wide interval and little evidence. Evidence that campaigns differ is the ratio of the marginal
likelihoods with c and without, for a mixture of A: an e-value. The mean has a flat prior in both.

Intervals of differences are those of campaigns of which nothing is expected (c flat): a mixture over the scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import logsumexp, ndtr

from sysid_ros.fleet.changes.evidence import SIZES
from sysid_ros.fleet.changes.pooled import SCATTER_PRIOR
from sysid_ros.fleet.changes.series import by_bag, series_of
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.fleet.store import Store
from sysid_ros.sample import FloatArray

_WIDTHS = 4.0
"""Of the prior of the scatter's logarithm, that are summed over on each side, in standard deviations."""
_STEPS = 81
_NORMAL = 1.959964

Interval = tuple[float, float, float]
"""Median and ends of a 95 % interval."""


@dataclass(frozen=True, eq=False, slots=True)
class Compared:
    """A parameter of a joint in each campaign.

    Attributes:
        log_e: logarithm of the e-value that campaigns differ. values: of each campaign [SI], None where no bag tells it.
        differences: to the campaign before it that tells it, or, where their order is not known, to the first that does.
    """

    joint: str
    quantity: str
    log_e: float
    values: tuple[Interval | None, ...]
    differences: tuple[Interval | None, ...]


@dataclass(frozen=True, eq=False, slots=True)
class RobotCampaigns:
    """A robot over its campaigns.

    Attributes:
        campaigns: names, in the order of time where that is known, else by name. bags: paths of each. in_order: whether it is.
        compared: what at least two campaigns tell. notes: in sentences.
    """

    robot: str
    campaigns: tuple[str, ...]
    bags: tuple[tuple[str, ...], ...]
    in_order: bool
    compared: tuple[Compared, ...]
    notes: tuple[str, ...]


def campaigns_of(store: Store) -> tuple[RobotCampaigns, ...]:
    """Every robot of which the store has bags with a campaign in place of a date."""
    names = ["bag", "hash", "model", "version", "job", "robot", "kind", "status", "campaign", "campaign_order"]
    rows = [b for b in store.read("bags", names).to_pylist() if b["campaign"] and b["job"] == "track" and b["status"] == "ok"]
    if not rows:
        return ()
    joints = by_bag(store, "joints")
    robots: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        robots.setdefault(row["robot"], []).append(row)
    return tuple(_robot(name, some, joints) for name, some in sorted(robots.items()))


def _robot(name: str, bags: list[dict[str, Any]], joints: dict[tuple[str, str, str], list[dict[str, Any]]]) -> RobotCampaigns:
    notes = []
    models = [b["model"] for b in bags]
    model = max(sorted(set(models)), key=models.count)
    kept = {b["hash"]: b for b in sorted(bags, key=lambda b: (b["bag"], b["version"])) if b["model"] == model}
    if others := len({b["hash"] for b in bags}) - len(kept):
        notes.append(f"{name} was known by several models: {others} bags with another than most have are not compared.")
    chosen = sorted(kept.values(), key=lambda b: str(b["bag"]))
    in_order = all(b["campaign_order"] is not None for b in chosen)
    places = {b["campaign"]: b["campaign_order"] if in_order else 0 for b in chosen}
    campaigns = sorted(places, key=lambda c: (places[c], c))
    group = np.array([campaigns.index(b["campaign"]) for b in chosen])
    sizes = np.bincount(group, minlength=len(campaigns))
    if alone := [c for c, size in zip(campaigns, sizes, strict=True) if size == 1]:
        notes.append(f"Of campaign {', '.join(alone)} there is one bag: what differs there may be of that bag alone.")
    series = series_of([joints.get((b["hash"], b["model"], b["version"]), []) for b in chosen])
    found = []
    for one in series:
        for p, quantity in enumerate(JOINT_PARAMETERS):
            made = compare(one.y[:, p], one.covariance[:, p, p], group[one.bags], len(campaigns), in_order)
            if made is not None:
                found.append(Compared(one.joint, quantity, *made))
    of_each = [tuple(b["bag"] for b in chosen if b["campaign"] == c) for c in campaigns]
    return RobotCampaigns(name, tuple(campaigns), tuple(of_each), in_order, tuple(found), tuple(notes))


def compare(
    y: FloatArray, variance: FloatArray, group: Any, count: int, in_order: bool
) -> tuple[float, tuple[Interval | None, ...], tuple[Interval | None, ...]] | None:
    """Logarithm of the e-value that campaigns differ, the value of each, and its difference; None where only one tells it.

    Args:
        y, variance: estimates and what is stated of them, shape (N,), NaN where there is none. group: campaign of each, shape
            (N,). count: of campaigns. in_order: differences are to the one before.
    """
    known = np.isfinite(y) & np.isfinite(variance) & (variance > 0.0)
    y, variance, group = y[known], variance[known], np.asarray(group)[known]
    there = sorted(set(group.tolist()))
    if len(there) < 2:
        return None
    unit = float(np.median(variance))
    mean, std = SCATTER_PRIOR
    log_r = np.linspace(mean - _WIDTHS * std, mean + _WIDTHS * std, _STEPS)
    prior = -0.5 * ((log_r - mean) / std) ** 2
    each = variance + unit * np.exp(log_r)[:, None]
    usual = unit * (1.0 + np.exp(log_r))
    alike = (group[:, None] == group).astype(float)
    same, everything = np.ones((len(y), 1)), (group[:, None] == there).astype(float)
    none = _restricted(y, each, 0.0 * usual, alike, same) + prior
    with_some = np.stack([_restricted(y, each, a**2 * usual, alike, same) + prior for a in SIZES])
    log_e = float(logsumexp(with_some) - np.log(len(SIZES)) - logsumexp(none))
    free = _restricted(y, each, 0.0 * usual, alike, everything) + prior
    weights = np.exp(free - logsumexp(free))
    precision = (1.0 / each) @ everything
    means, variances = ((y / each) @ everything) / precision, 1.0 / precision
    values: list[Interval | None] = [None] * count
    differences: list[Interval | None] = [None] * count
    for i, k in enumerate(there):
        values[k] = _interval(means[:, i], variances[:, i], weights)
        if i:
            other = i - 1 if in_order else 0
            differences[k] = _interval(means[:, i] - means[:, other], variances[:, i] + variances[:, other], weights)
    return log_e, tuple(values), tuple(differences)


def _restricted(y: FloatArray, each: FloatArray, shared: FloatArray, alike: FloatArray, X: FloatArray) -> FloatArray:
    """Logarithm of the likelihood of y whose mean is X times anything (restricted, flat prior), for each scatter, shape (R,).

    Args:
        y: shape (N,). each: variances, shape (R, N). shared: variance that bags of one campaign share, shape (R,). alike: 1 for
            bags of one campaign, shape (N, N). X: shape (N, m).
    """
    V = shared[:, None, None] * alike
    at = np.arange(len(y))
    V[:, at, at] += each
    inverse = np.linalg.inv(V)
    A = X.T @ inverse @ X
    b = (X.T @ inverse @ y)[..., None]
    left = np.einsum("i,rij,j->r", y, inverse, y) - (b * np.linalg.solve(A, b)).sum(axis=(1, 2))
    return np.asarray(-0.5 * (np.linalg.slogdet(V)[1] + np.linalg.slogdet(A)[1] + left))


def _interval(means: FloatArray, variances: FloatArray, weights: FloatArray) -> Interval:
    """Median and ends of a mixture of normal distributions."""
    std = np.sqrt(variances)
    ends = float(np.min(means - 10.0 * std)), float(np.max(means + 10.0 * std))
    out = []
    for wanted in (0.5, ndtr(-_NORMAL), ndtr(_NORMAL)):
        low, high = ends
        for _ in range(80):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if weights @ ndtr((middle - means) / std) < wanted else (low, middle)
        out.append(0.5 * (low + high))
    return out[0], out[1], out[2]


def log_es(robots: Sequence[RobotCampaigns]) -> list[float]:
    """Of every look at a parameter over campaigns."""
    return [c.log_e for robot in robots for c in robot.compared]
