"""What a report tells of campaigns: as a table of the page and of the terminal, and for machines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.fleet.changes.alarms import percent, probability_of
from sysid_ros.fleet.changes.campaigns import Compared, Interval, RobotCampaigns
from sysid_ros.fleet.changes.quantities import QUANTITIES

_ORDERED = "Their dates are not known, their order is, as robots.yaml tells it: differences are to the campaign before."
_UNORDERED = "Neither their dates nor their order are known: differences are to the first, and say nothing of what was before."
_MOTION = (
    "Campaigns that move otherwise also differ by what the known model gets wrong on either motion; where all do, that and a "
    "change of the robot can't be told apart."
)


def tables(robots: Sequence[RobotCampaigns], limit: float, share: float) -> list[dict[str, Any]]:
    """A table a robot, in words: what is told first, then all else.

    Args:
        limit: logarithm of the e-value from which a difference is told. share: of looks that show a change.
    """
    out = []
    for robot in robots:
        rows = sorted(robot.compared, key=lambda c: -c.log_e)
        out.append(
            {
                "robot": robot.robot,
                "campaigns": list(robot.campaigns),
                "bags": [len(bags) for bags in robot.bags],
                "told": [_row(c, share) for c in rows if c.log_e >= limit],
                "others": [_row(c, share) for c in rows if c.log_e < limit],
                "said": [_ORDERED if robot.in_order else _UNORDERED, _MOTION, *robot.notes],
            }
        )
    return out


def answer(robots: Sequence[RobotCampaigns], limit: float) -> str:
    """In a sentence; empty without campaigns."""
    if not robots:
        return ""
    differ = sum(any(c.log_e >= limit for c in robot.compared) for robot in robots)
    of = f"{len(robots)} robot{'s' if len(robots) > 1 else ''} known by campaigns"
    return (
        f"{differ} of {of} {'differs' if differ == 1 else 'differ'} between them."
        if differ
        else f"Of {of}, none differs between them by more than its bags scatter."
    )


def document(robots: Sequence[RobotCampaigns], limit: float, share: float) -> list[dict[str, Any]]:
    """For machines, in SI units."""
    return [
        {
            "robot": robot.robot,
            "campaigns": [{"name": c, "bags": list(bags)} for c, bags in zip(robot.campaigns, robot.bags, strict=True)],
            "order_known": robot.in_order,
            "compared": [
                {
                    "joint": c.joint,
                    "quantity": c.quantity,
                    "told": c.log_e >= limit,
                    "log_e": c.log_e,
                    "probability": probability_of(c.log_e, share),
                    "values": [_interval(v) for v in c.values],
                    "differences": [_interval(v) for v in c.differences],
                }
                for c in robot.compared
            ],
            "notes": list(robot.notes),
        }
        for robot in robots
    ]


def _interval(given: Interval | None) -> dict[str, float] | None:
    return None if given is None else dict(zip(("value", "low", "high"), given, strict=True))


def _row(c: Compared, share: float) -> dict[str, Any]:
    of = QUANTITIES[c.quantity]
    cells = [_cell(v, d, of.factor) for v, d in zip(c.values, c.differences, strict=True)]
    return {
        "what": f"{of.words} of {c.joint}",
        "unit": of.unit,
        "quantity": c.quantity,
        "cells": cells,
        "probability": percent(probability_of(c.log_e, share)),
    }


def _cell(value: Interval | None, difference: Interval | None, factor: float) -> dict[str, str]:
    """A value and its difference with the 95 % intervals, in the unit that is shown."""
    if value is None:
        return {"value": "not told", "difference": ""}
    v = _rounded(value, factor)
    said = {"value": f"{v[0]} ({v[1]} to {v[2]})", "difference": ""}
    if difference is not None:
        d = _rounded(difference, factor, "+")
        said["difference"] = f"{d[0]} ({d[1]} to {d[2]})"
    return said


def _rounded(given: Interval, factor: float, sign: str = "") -> list[str]:
    """To two digits of the interval's width."""
    middle, low, high = (x * factor for x in given)
    places = max(0, 1 - int(np.floor(np.log10(max(high - low, 1e-9)))))
    return [f"{x:{sign}.{places}f}" for x in (middle, low, high)]
