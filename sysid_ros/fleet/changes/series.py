"""Series: what the store tells of each joint of each robot over time, in arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.fleet.changes.quantities import Costs
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.fleet.store import Store
from sysid_ros.sample import FloatArray

_DAY = 86400.0
_COSTS = ("torque", "lever", "torque_per_zero", "torque_per_mass")
"""Columns of the joints that :class:`.Costs` are of, in its order."""


@dataclass(frozen=True, eq=False, slots=True)
class Series:
    """A joint over time.

    Attributes:
        bags: index into the robot's bags, shape (N,). y: estimates, shape (N, 8), NaN where there is none, in the order of
            ``JOINT_PARAMETERS``. covariance: shape (N, 8, 8). temperature: shape (N,) [degrees Celsius], NaN where unknown.
        costs: median over its bags.
    """

    joint: str
    bags: Any
    y: FloatArray
    covariance: FloatArray
    temperature: FloatArray
    costs: Costs


@dataclass(frozen=True, eq=False, slots=True)
class RobotSeries:
    """A robot over time.

    Attributes:
        days: of its bags since the first date of the fleet, shape (N,), ascending. bags: their paths. hashes: of their content.
        joints: its joints. mass, mass_std: of the lightest thing that it carried in a bag, shape (N,) [kg], NaN where unknown.
    """

    name: str
    kind: str
    days: FloatArray
    bags: tuple[str, ...]
    hashes: tuple[str, ...]
    joints: tuple[Series, ...]
    mass: FloatArray
    mass_std: FloatArray

    @property
    def over_time(self) -> bool:
        """Whether its bags are of more than one date: of one alone no change can be told."""
        return bool(self.days[-1] > self.days[0])


@dataclass(frozen=True, eq=False, slots=True)
class FleetSeries:
    """All robots that have bags with a date; ``start`` is the day 0 of all. ``notes``: what of the store was left out, in
    sentences."""

    start: datetime
    robots: tuple[RobotSeries, ...]
    notes: tuple[str, ...]

    def date(self, day: float) -> datetime:
        """The date so many days after the start."""
        return self.start + timedelta(days=float(day))

    @property
    def last(self) -> float:
        """Of the last bag [days]; 0 without one."""
        return max((float(r.days[-1]) for r in self.robots), default=0.0)


def fleet_series(store: Store) -> FleetSeries:
    """What ``track`` found, by robot.

    A robot that was known by several models is judged by the bags of its last one: estimates against different models do not
    compare.

    Raises:
        DataError: the store holds no bag with a date or a campaign that ``track`` read.
    """
    names = ["bag", "hash", "model", "version", "job", "robot", "kind", "date", "status", "campaign"]
    rows = store.read("bags", names).to_pylist()
    bags = [b for b in rows if b["job"] == "track" and b["status"] == "ok" and b["date"] is not None]
    if not bags:
        if any(b["job"] == "track" and b["status"] == "ok" and b["campaign"] for b in rows):
            return FleetSeries(datetime.fromtimestamp(0.0, UTC), (), ())
        raise DataError(
            f"store '{store.path}' holds no bag with a date that the job track has read. Give it some: sysid batch ..."
        )
    notes: list[str] = []
    by_robot: dict[str, list[dict[str, Any]]] = {}
    for bag in bags:
        by_robot.setdefault(bag["robot"], []).append(bag)
    joints, payloads = by_bag(store, "joints"), by_bag(store, "payloads")
    start = min(b["date"] for b in bags).astimezone(UTC)
    robots = [_robot(name, some, joints, payloads, start, notes) for name, some in sorted(by_robot.items())]
    for robot in robots:
        if not robot.over_time:
            notes.append(f"{robot.name}: its {len(robot.bags)} bags are all of one date; whether it changed can't be told.")
    return FleetSeries(start, tuple(robots), tuple(notes))


def _key(row: dict[str, Any]) -> tuple[str, str, str]:
    return row["hash"], row["model"], row["version"]


def by_bag(store: Store, table: str) -> dict[tuple[str, str, str], list[dict[str, Any]]]:
    """Rows of ``joints`` or ``payloads`` that ``track`` wrote, by hash, model and version."""
    columns = [c for p in JOINT_PARAMETERS for c in (p, f"{p}_std")]
    own = {"joints": ["joint", "temperature", "covariance", *_COSTS, *columns], "payloads": ["mass", "mass_std", "status"]}[table]
    found: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for row in store.read(table, ["hash", "model", "version", "job", *own]).to_pylist():
        if row["job"] == "track":
            found.setdefault(_key(row), []).append(row)
    return found


def _robot(
    name: str,
    bags: list[dict[str, Any]],
    joints: dict[tuple[str, str, str], list[dict[str, Any]]],
    payloads: dict[tuple[str, str, str], list[dict[str, Any]]],
    start: datetime,
    notes: list[str],
) -> RobotSeries:
    bags = sorted(bags, key=lambda b: (b["date"], b["bag"], b["version"]))
    model = bags[-1]["model"]
    kept = {b["hash"]: b for b in bags if b["model"] == model}  # of one bag the newest version of the package
    if len(kept) < (known := len({b["hash"] for b in bags})):
        notes.append(f"{name} was known by other models before: {known - len(kept)} of its {known} bags are not judged.")
    chosen = sorted(kept.values(), key=lambda b: (b["date"], b["bag"]))
    days = np.array([(b["date"].astimezone(UTC) - start).total_seconds() / _DAY for b in chosen])
    loads = np.array([_lightest(payloads.get(_key(bag), [])) for bag in chosen])
    return RobotSeries(
        name,
        chosen[-1]["kind"],
        days,
        tuple(b["bag"] for b in chosen),
        tuple(b["hash"] for b in chosen),
        series_of([joints.get(_key(bag), []) for bag in chosen]),
        loads[:, 0],
        loads[:, 1],
    )


def series_of(bags: Sequence[Sequence[dict[str, Any]]]) -> tuple[Series, ...]:
    """Each joint over some bags, from the rows of each bag."""
    rows: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    for k, of in enumerate(bags):
        for row in of:
            rows.setdefault(row["joint"], []).append((k, row))
    return tuple(_series(joint, of) for joint, of in rows.items())


def _lightest(rows: Sequence[dict[str, Any]]) -> tuple[float, float]:
    known = [(r["mass"], r["mass_std"]) for r in rows if r["mass"] is not None and r["mass_std"] is not None]
    return min(known) if known else (np.nan, np.nan)


def _series(joint: str, rows: Sequence[tuple[int, dict[str, Any]]]) -> Series:
    p = len(JOINT_PARAMETERS)
    y = np.array([[_number(row[name]) for name in JOINT_PARAMETERS] for _, row in rows])
    std = np.array([[_number(row[f"{name}_std"]) for name in JOINT_PARAMETERS] for _, row in rows])
    covariance = np.array(
        [np.full((p, p), np.nan) if row["covariance"] is None else np.reshape(row["covariance"], (p, p)) for _, row in rows]
    )
    k = np.arange(p)
    # the diagonal is what the table says of each parameter; what is no number beside it is taken as independent
    covariance[np.isnan(covariance)] = 0.0
    covariance[:, k, k] = std**2
    y[~np.isfinite(std)] = np.nan
    heat = np.array([_number(row["temperature"]) for _, row in rows])
    costs = (np.array([row[name] for _, row in rows if row[name] is not None]) for name in _COSTS)
    usual = (float(np.median(values)) if values.size else None for values in costs)
    return Series(joint, np.array([i for i, _ in rows]), y, covariance, heat, Costs(joint, *usual))


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)
