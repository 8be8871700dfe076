"""The page of a fleet: robots by time with what changed, then each robot, joint and bag; one HTML file without a network."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from datetime import timedelta
from typing import Any

import numpy as np

from sysid_ros.fleet import campaign_table
from sysid_ros.fleet.changes.alarms import Alarm, changed_share, limit_of, percent
from sysid_ros.fleet.changes.campaigns import RobotCampaigns, log_es
from sysid_ros.fleet.changes.fleet_changes import FleetChanges, JointHistory
from sysid_ros.fleet.changes.quantities import CARRIED, QUANTITIES
from sysid_ros.fleet.changes.series import FleetSeries, RobotSeries
from sysid_ros.fleet.schema import JOINT_PARAMETERS
from sysid_ros.pages.page import page
from sysid_ros.sample import FloatArray

_MOST_POINTS = 250_000
"""Of all curves: a page of some 4 MB. Where a fleet has more, robots without an alarm are shown without their curves."""
_MOST_BAGS = 400
"""Of one curve; evenly chosen."""
_MOST_FAILED = 50


def fleet_page(
    changes: FleetChanges,
    alarms: Sequence[Alarm],
    failed: Sequence[Mapping[str, Any]],
    rate: float,
    where: str,
    campaigns: Sequence[RobotCampaigns] = (),
) -> str:
    """HTML of the page.

    Args:
        alarms: what is told, the surest first. failed: rows of bags that could not be read. rate: of false discoveries.
        where: the store. campaigns: of robots of which no dates are known.
    """
    looks = [*changes.looks, *log_es(campaigns)]
    limit = limit_of(looks, rate)
    told = [_told(a, changes) for a in alarms]
    robots = _ordered(changes, alarms)
    drawn = _drawn(changes, {a.change.robot for a in alarms})
    names = {r.name for r in robots} | {r.robot for r in campaigns}
    bags = sum(len(r.bags) for r in robots) + sum(len(of) for r in campaigns for of in r.bags)
    start, end = changes.series.start, changes.series.date(changes.series.last)
    return page(
        "fleet.html",
        answer=answer(alarms, changes.series, campaigns, limit),
        where=f"{where}, {start:%Y-%m-%d} to {end:%Y-%m-%d}" if robots else where,
        lead=f"{_count(len(names), 'robot')}, {_count(bags, 'bag')}. Of what is told, at most {100 * rate:g} % is expected to be "
        "false.",
        alarms=told,
        rows=[_row(r, changes, [t for t in told if t["robot"] == r.name]) for r in robots],
        months=_months(changes),
        kinds=[{"name": name, "words": q.words} for name, q in QUANTITIES.items() if any(t["quantity"] == name for t in told)],
        failed=[{"bag": f["bag"], "reason": f["reason"]} for f in failed[:_MOST_FAILED]],
        failed_count=len(failed),
        campaigns=campaign_table.tables(campaigns, limit, changed_share(looks)),
        notes=[*changes.series.notes, *_left_out(robots, drawn)],
        data={
            "start": start.isoformat(),
            "last": round(changes.series.last, 2),
            "quantities": [_quantity(name) for name in (*JOINT_PARAMETERS, CARRIED)],
            "robots": [_robot(r, changes, r.name in drawn) for r in robots],
            "alarms": told,
        },
    )


def answer(alarms: Sequence[Alarm], series: FleetSeries, campaigns: Sequence[RobotCampaigns] = (), limit: float = np.inf) -> str:
    """In a sentence or two; robots whose bags are of one date are no robots of which nothing changed."""
    changed, judged = len({a.change.robot for a in alarms}), sum(r.over_time for r in series.robots)
    of = _count(judged, "robot")
    said = f"{changed} of {of} changed." if changed else f"Nothing changed on {of} that the bags could show."
    if not judged:
        said = "Whether anything changed can't be told: every robot's bags are of one date." if series.robots else ""
    return " ".join(filter(None, [said, campaign_table.answer(campaigns, limit)]))


def _count(number: int, of: str) -> str:
    return f"{number} {of}{'' if number == 1 else 's'}"


def _ordered(changes: FleetChanges, alarms: Sequence[Alarm]) -> list[RobotSeries]:
    """Robots with alarms first, the latest on top; then the others by name."""
    latest: dict[str, float] = {}
    for a in alarms:
        latest[a.change.robot] = max(latest.get(a.change.robot, 0.0), a.change.since[0])
    return sorted(changes.series.robots, key=lambda r: (-latest.get(r.name, -1.0), r.name))


def _drawn(changes: FleetChanges, alarmed: set[str]) -> set[str]:
    """Robots whose curves the page holds."""
    points = {r.name: sum(min(len(j.bags), _MOST_BAGS) * len(JOINT_PARAMETERS) for j in r.joints) for r in changes.series.robots}
    out: set[str] = set()
    total = 0
    for name in sorted(points, key=lambda n: n not in alarmed):
        total += points[name]
        if total > _MOST_POINTS and name not in alarmed:
            break
        out.add(name)
    return out


def _left_out(robots: Sequence[RobotSeries], drawn: set[str]) -> list[str]:
    left = [r.name for r in robots if r.name not in drawn]
    return [f"The page holds no curves of {len(left)} robots on which nothing changed: it would be too large."] if left else []


def _told(alarm: Alarm, changes: FleetChanges) -> dict[str, Any]:
    """An alarm in plain types, with its dates and places on the page."""
    c, date = alarm.change, changes.series.date
    others = [QUANTITIES[name].words for name in alarm.cannot_be_told_from]
    return {
        "robot": c.robot,
        "joint": c.joint,
        "quantity": c.quantity,
        "what": alarm.what,
        "since": f"{date(c.since[0]):%Y-%m-%d}",
        "from": f"{date(c.since[1]):%Y-%m-%d}",
        "to": f"{date(c.since[2]):%Y-%m-%d}",
        "day": [round(x, 2) for x in c.since],
        "length": round(c.length, 1) if c.sudden < 0.5 else 0.0,
        "how": "at once" if c.sudden >= 0.5 else f"over {c.length:.0f} days",
        "probability": percent(alarm.probability),
        "of_kind": percent(alarm.of_kind),
        "others": others,
        "cost": alarm.cost,
        "look": alarm.look,
        "before": list(alarm.before),
        "after": list(alarm.after),
        "commands": commands(alarm),
    }


def commands(alarm: Alarm) -> list[str]:
    """What to give to have the bags after held against the model of those before."""
    if not alarm.before or not alarm.after:
        return []
    name = f"{alarm.change.robot}_before.yaml"
    before, after = shlex.join(alarm.before), shlex.join(alarm.after)
    out = shlex.quote(f"{alarm.change.robot}_diagnosis")
    return [
        f"sysid identify {before} --out {shlex.quote(name)}",
        f"sysid diagnose {after} --model {shlex.quote(name)} --out {out}",
    ]


def _row(robot: RobotSeries, changes: FleetChanges, told: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """A robot's lane: places in per cent of the time."""
    whole = max(changes.series.last, 1e-9)

    def at(day: float) -> float:
        return round(100.0 * min(max(day / whole, 0.0), 1.0), 2)

    marks = [
        {
            "quantity": t["quantity"],
            "low": at(t["day"][1]),
            "width": round(at(t["day"][2]) - at(t["day"][1]), 2),
            "at": at(t["day"][0]),
            "full": at(t["day"][0] + t["length"]),
            "title": f"{t['what']}, {t['since']}",
            "joint": t["joint"],
        }
        for t in told
    ]
    first, last = at(float(robot.days[0])), at(float(robot.days[-1]))
    words = "; ".join(t["what"] for t in told)
    return {"robot": robot.name, "kind": robot.kind, "first": first, "last": last, "marks": marks, "words": words}


def _months(changes: FleetChanges) -> list[dict[str, Any]]:
    """First days of months, at most a dozen of them, in per cent of the time."""
    start, whole = changes.series.start, max(changes.series.last, 1e-9)
    out = []
    for day in range(int(whole) + 1):
        date = start + timedelta(days=day)
        if date.day == 1:
            out.append({"at": round(100.0 * day / whole, 2), "text": f"{date:%b}", "year": f"{date:%Y}"})
    step = max(1, -(-len(out) // 12))
    return out[::step]


def _quantity(name: str) -> dict[str, Any]:
    of = QUANTITIES[name]
    return {"name": name, "words": of.words, "unit": of.unit}


def _robot(robot: RobotSeries, changes: FleetChanges, drawn: bool) -> dict[str, Any]:
    out: dict[str, Any] = {"name": robot.name, "kind": robot.kind, "days": _short(robot.days, 6), "joints": []}
    if drawn:
        out |= {"bags": list(robot.bags), "mass": _short(robot.mass), "mass_std": _short(robot.mass_std, 2)}
        out["joints"] = [_joint(h) for h in changes.histories if h.robot == robot.name]
    return out


def _joint(history: JointHistory) -> dict[str, Any]:
    """Curves of a joint in the units that are shown: value and std of each bag, level and its std."""
    keep = np.unique(np.linspace(0, len(history.days) - 1, min(len(history.days), _MOST_BAGS)).round().astype(int))
    curves = []
    for p, name in enumerate(JOINT_PARAMETERS):
        factor = QUANTITIES[name].factor
        y, variance = history.series.y[keep, p], history.series.covariance[keep, p, p]
        level, std = history.level[keep, p], history.level_std[keep, p]
        parts = ((y, 4), (np.sqrt(variance), 2), (level, 4), (std, 2))
        curves.append([_short(part * factor, digits) for part, digits in parts])
    return {"name": history.joint, "at": history.series.bags[keep].tolist(), "odd": list(history.odd), "curves": curves}


def _short(values: FloatArray, digits: int = 4) -> list[float | None]:
    """Rounded to some digits of the widest; None for what is not known."""
    known = np.abs(values[np.isfinite(values)])
    if not known.size or not known.max():
        return [0.0 if np.isfinite(v) else None for v in values]
    places = digits - 1 - int(np.floor(np.log10(known.max())))
    return [round(float(v), places) if np.isfinite(v) else None for v in values]
