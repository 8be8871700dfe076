"""What a diagnosis got right, from its ``diagnosis.json`` and the truth."""

from __future__ import annotations

from typing import Any

import numpy as np

from exam.claims import same
from sysid_ros.simulation.hidden_effects import CAUSES, cause_of

ROBUST = 1e-9


def score(truth: dict[str, Any], document: dict[str, Any]) -> dict[str, Any]:
    """Named, exact, joints, covered, ratios of one case.

    Args:
        truth: of the case. document: the diagnosis as in ``diagnosis.json``.
    """
    hidden, level = list(truth["hidden"]), truth["level"]
    effects = document["effects"]
    background = {id_ for id_, cause in CAUSES.items() if cause.everywhere} if level == "hard" else set()
    beyond = [e for e in effects if e["name"] not in background]
    named = [e["name"] for e in beyond]
    tolerated = {x for h in hidden for x in cause_of(h).companions}
    out: dict[str, Any] = {
        "verdict": document["verdict"],
        "named": [e["name"] for e in effects],
        "first": named[0] if named else document["verdict"],
        "unexplained": document.get("unexplained_fraction"),
        **residual(document),
    }
    if level == "healthy":
        return {**out, "right": document["verdict"] == "nothing_wrong"}
    if level == "outside":
        return {**out, "right": document["verdict"] in ("unexplained", "partly_explained")}
    first = _is_one_of(beyond[0], hidden) if beyond else False
    found = [h for h in hidden if any(_is_one_of(e, [h]) for e in beyond)]
    extra = [x for x in named if x not in hidden and x not in tolerated and not any(same(x, h) for h in hidden if h not in named)]
    joints = {h: _joints_right(_true_effect(truth, h), effects) for h in hidden if h in named}
    covered = [c for h in hidden if joints.get(h) and cause_of(h).sized for c in covered_by(_true_effect(truth, h), effects)]
    return {
        **out,
        "right": first,
        "found": len(found),
        "all_found": len(found) == len(hidden),
        "exact": len(found) == len(hidden) and not extra,
        "extra": extra,
        "joints": all(joints.get(h, False) or h not in named for h in hidden) and bool(joints) if joints else None,
        "covered": float(np.mean([c for _, c in covered])) if covered else None,
        "sizes": covered,
    }


def _is_one_of(effect: dict[str, Any], hidden: list[str]) -> bool:
    """Named by its own id, or by an equivalent one that admits it."""
    name = effect["name"]
    return name in hidden or any(h in effect.get("cannot_be_told_from", ()) and same(name, h) for h in hidden)


def _true_effect(truth: dict[str, Any], id_: str) -> dict[str, Any]:
    return next(e for e in truth["effects"] if e["name"] == id_)


def _entries(id_: str, effects: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [e for e in effects if e["name"] == id_]


def _joints_right(true: dict[str, Any], effects: list[dict[str, Any]]) -> bool:
    cause = cause_of(true["name"])
    if cause.whole_arm:
        return True
    named = [j for e in _entries(true["name"], effects) for j in e["joints"]]
    return named == true["joints"] if cause.ordered else set(named) == set(true["joints"])


def covered_by(true: dict[str, Any], effects: list[dict[str, Any]]) -> list[tuple[str, bool]]:
    """Is the true size inside the interval, for every number that the diagnosis states."""
    counted = cause_of(true["name"]).counted
    stated = [p for e in _entries(true["name"], effects) for p in e["parameters"]]
    out = []
    for p in true["parameters"]:
        match = [s for s in stated if s["name"] == p["name"] and (p["joint"] is None or s["joint"] in (p["joint"], None))]
        for s in match[:1] if p["joint"] is not None else match:
            if isinstance(p["value"], str) or p["name"] in counted:
                continue
            low, high = (np.atleast_1d(np.asarray(x, dtype=float)) for x in s["ci95"])
            value = np.atleast_1d(np.asarray(p["value"], dtype=float))
            out += [(p["name"], bool(lo - ROBUST <= x <= hi + ROBUST)) for x, lo, hi in zip(value, low, high, strict=True)]
    return out


def residual(document: dict[str, Any]) -> dict[str, Any]:
    """Held-out torque error in noise floors, rms over the joints."""
    rmse = document.get("torque_rmse") or {}
    floor = np.array(rmse.get("noise_floor") or [], dtype=float)
    if not floor.size:
        return {"before": None, "after": None}
    before, after = (np.asarray(rmse[k], dtype=float) / np.maximum(floor, 1e-12) for k in ("before", "after"))
    return {"before": float(np.sqrt(np.mean(before**2))), "after": float(np.sqrt(np.mean(after**2)))}
