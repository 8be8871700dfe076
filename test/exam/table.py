"""Results as tables and as the numbers that have targets."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any

import numpy as np

from exam.real_scoring import real_measures, render_real
from sysid_ros.simulation.hidden_effects import CAUSES

# what must hold: level -> (measure, at least, at most)
TARGETS = {
    "single": (
        ("first", 0.98, 1.0),
        ("exact", 0.97, 1.0),
        ("joints", 0.97, 1.0),
        ("covered", 0.88, 0.98),
        ("after", 0.0, 1.2),
        ("worst id", 2.0 / 3.0, 1.0),
    ),
    "hard": (("first", 0.94, 1.0), ("exact", 0.92, 1.0), ("covered", 0.90, 0.97)),
    "pairs": (("both", 0.95, 1.0), ("exact", 0.90, 1.0), ("first", 0.97, 1.0)),
    "healthy": (("right", 0.99, 1.0),),
    "outside": (("right", 1.0, 1.0),),
    "real": (
        ("refused", 0.0, 0.01),
        ("named", 0.95, 1.0),
        ("covered", 0.90, 0.98),
        ("false", 0.0, 0.05),
        ("worse", 0.0, 0.01),
        ("ratio", 0.0, 0.75),
    ),
}


def share(rows: list[dict[str, Any]], key: str) -> float:
    """Mean over the rows that have the key, NaN where none has."""
    values = [float(r[key]) for r in rows if r.get(key) is not None]
    return float(np.mean(values)) if values else float("nan")


def measures(level: str, rows: list[dict[str, Any]]) -> dict[str, float]:
    """The numbers that have targets, and some that have none."""
    if level == "real":
        return real_measures(rows)
    after = [r["after"] for r in rows if r.get("after") is not None]
    out = {
        "right": share(rows, "right"),
        "first": share(rows, "right"),
        "exact": share(rows, "exact"),
        "both": share(rows, "all_found"),
        "joints": share(rows, "joints"),
        "covered": share(rows, "covered"),
        "before": float(np.median([r["before"] for r in rows if r.get("before") is not None])) if after else float("nan"),
        "after": float(np.median(after)) if after else float("nan"),
    }
    if level == "single":
        by_id = {id_: share(of, "right") for id_, of in grouped(rows).items() if id_ not in CAUSES or not CAUSES[id_].rattles}
        out["worst id"] = min(by_id.values()) if by_id else float("nan")
    return out


def grouped(rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Rows by what was hidden first."""
    out: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for r in rows:
        out[r["hidden"][0] if r["hidden"] else "nothing"].append(r)
    return dict(sorted(out.items()))


def failed_targets(level: str, rows: list[dict[str, Any]]) -> list[str]:
    """What does not hold, in words; an answer that is not a number does not hold."""
    numbers = measures(level, rows)
    return [
        f"{name} is {numbers[name]:.3f}; it must be {low:.3g} to {high:.3g}"
        for name, low, high in TARGETS[level]
        if not low <= numbers[name] <= high
    ]


def render(level: str, rows: list[dict[str, Any]]) -> str:
    """Per hidden cause, then what was taken for what, then the numbers."""
    if level == "real":
        return render_real(rows)
    lines = [f"{'hidden':30s} {'n':>3s} {'first':>6s} {'exact':>6s} {'joints':>6s} {'cover':>6s} {'before':>8s} {'after':>7s}"]
    for id_, of in grouped(rows).items():
        m = measures(level, of)
        numbers = " ".join(f"{m[k]:6.2f}" for k in ("first", "exact", "joints", "covered"))
        lines.append(f"{id_:30s} {len(of):3d} {numbers} {m['before']:8.1f} {m['after']:7.2f}")
    lines += ["", "taken for (cases that were not right, or not exact):"]
    confusion: dict[str, Counter[str]] = defaultdict(Counter)
    for r in rows:
        if not r["right"] or r.get("exact") is False:
            confusion[" + ".join(r["hidden"]) or "nothing"][" + ".join(r["named"]) or r["verdict"]] += 1
    for id_, taken in sorted(confusion.items()):
        lines.append(f"  {id_}: " + "; ".join(f"{name} x{count}" for name, count in taken.most_common()))
    lines += ["", "  ".join(f"{k} {v:.3f}" for k, v in measures(level, rows).items() if v == v)]
    return "\n".join(lines)
