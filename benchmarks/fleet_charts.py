"""Control charts, one a parameter, as factories have them: CUSUM and moving average on the same store as the fleet's changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid_ros.fleet.changes.quantities import CARRIED
from sysid_ros.fleet.changes.series import FleetSeries
from sysid_ros.fleet.schema import JOINT_PARAMETERS

BASE = 10
"""Bags from which a chart takes its mean and standard deviation (phase I)."""
SLACK, DECISION = 0.5, 5.0
"""Of a CUSUM, in standard deviations (Montgomery 2009, section 9.1)."""
WINDOW, LIMIT = 5, 3.0
"""Of a moving average (Montgomery 2009, section 9.3)."""

Vector = np.ndarray[tuple[int], np.dtype[np.float64]]
Chart = Callable[[Vector], tuple[Vector, Vector]]


@dataclass(frozen=True, slots=True)
class Crossing:
    """A chart that was left: since which day, and how far it went [in its limits]."""

    robot: str
    joint: str
    quantity: str
    day: float
    worst: float


def cusum(z: Vector) -> tuple[Vector, Vector]:
    """The greater of both sums at each bag over its limit, and the index of the bag at which that sum left 0."""
    out, since = np.zeros((2, z.size)), np.zeros((2, z.size))
    for side, sign in enumerate((1.0, -1.0)):
        total, begin = 0.0, 0
        for b, value in enumerate(z.tolist()):
            total += sign * value - SLACK
            if total <= 0.0:
                total, begin = 0.0, b + 1
            out[side, b], since[side, b] = total / DECISION, begin
    which = np.argmax(out, axis=0)
    at = np.arange(z.size)
    return out[which, at], since[which, at]


def moving_average(z: Vector) -> tuple[Vector, Vector]:
    """The mean of the last bags over its limit, and the index of the first of them."""
    b = np.arange(z.size)
    first = np.maximum(b - WINDOW + 1, 0)
    sums = np.concatenate(([0.0], np.cumsum(z)))
    count = b - first + 1
    return np.abs(sums[b + 1] - sums[first]) / np.sqrt(count) / LIMIT, first.astype(float)


def crossings(series: FleetSeries, chart: Chart) -> list[Crossing]:
    """The worst of each parameter of each joint, and of what is carried, and since when: at its first crossing of 1, or nan."""
    found = []
    for robot in series.robots:
        charts: list[tuple[str, str, Any, Any]] = [
            (of.joint, name, of.y[:, p], of.bags) for of in robot.joints for p, name in enumerate(JOINT_PARAMETERS)
        ]
        charts.append(("", CARRIED, robot.mass, np.arange(len(robot.days))))
        for joint, name, y, bags in charts:
            known = np.isfinite(y)
            values, days = y[known], robot.days[bags][known]
            if values.size <= BASE:
                continue
            std = float(np.std(values[:BASE], ddof=1))
            height, since = chart((values - values[:BASE].mean()) / max(std, 1e-12))
            over = np.flatnonzero(height > 1.0)
            at = int(since[over[0]]) if over.size else 0
            found.append(Crossing(robot.name, joint, name, float(days[min(at, len(days) - 1)]), float(height.max())))
    return found


def told_by(found: list[Crossing], limit: float) -> list[Crossing]:
    """One alarm a joint: its parameter that went farthest, where that is beyond ``limit`` times the chart's own."""
    best: dict[tuple[str, str], Crossing] = {}
    for c in found:
        key = (c.robot, c.joint)
        if c.worst > limit and (key not in best or c.worst > best[key].worst):
            best[key] = c
    return list(best.values())
