"""What a diagnosis got right of a robot as it is, and the numbers of many of them."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from exam.claims import claimed, claims, is_true
from exam.scoring import covered_by, residual
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects import cause_of

WORSE = 1.05
"""Held-out error over that of the plain baseline from which a joint is worse."""


def score_real(truth: dict[str, Any], document: dict[str, Any], baseline: FloatArray) -> dict[str, Any]:
    """Refused, larger causes named and sized, false claims, joints worse than the plain baseline.

    A larger cause is named where it is claimed, or a cause that it is a part of, on one of its joints at least. What a robot as
    built has on the claimed joints is a true claim. Sizes are those of the entries that name it.

    Args:
        truth: of the case; ``larger`` are its larger causes. document: ``diagnosis.json``.
        baseline: held-out error of the plain baseline, shape (n,) [N m].
    """
    told = [e for e in document["effects"] if claimed(e)]
    marks = claims(truth, document)
    refused = document["verdict"] == "refused"
    larger = [_larger(e, document["effects"]) for e in truth["larger"]]
    sizes = [s for mark in larger for s in mark["sizes"]]
    ratio = _ratio(document, baseline)
    named = not refused and all(mark["named"] for mark in larger)
    false = [m for m in marks if claimed(m) and not m["true"]]
    return {
        "verdict": document["verdict"],
        "named": [e["name"] for e in told],
        "first": told[0]["name"] if told else document["verdict"],
        "unexplained": document.get("unexplained_fraction"),
        **residual(document),
        "refused": refused,
        "right": named,
        "all_found": named,
        "exact": named and not false,
        "larger": larger,
        "claimed": len(told),
        "extra": [f"{m['name']} ({', '.join(m['joints'])})" for m in false],
        "sizes": sizes,
        "covered": float(np.mean([c for _, c in sizes])) if sizes else None,
        "ratio": None if ratio is None else ratio.tolist(),
        "worse": [] if ratio is None else [j for j, x in zip(truth["joint_names"], ratio, strict=True) if x > WORSE],
    }


def _larger(hidden: dict[str, Any], effects: list[dict[str, Any]]) -> dict[str, Any]:
    """Was it named, with which probability, is it in the headline, and which of its numbers lie inside their intervals."""
    naming = [e for e in effects if is_true(e, [hidden]) or _holds(e, hidden)]
    told = [e for e in naming if claimed(e)]
    own = [{**e, "name": hidden["name"]} for e in told if e["name"] == hidden["name"] or _holds(e, hidden)]
    headlines = [e["headline"] for e in told if e.get("headline") is not None]
    return {
        "name": hidden["name"],
        "joints": hidden["joints"],
        "named": bool(told),
        "probability": max((p for e in naming if (p := e.get("probability")) is not None), default=None),
        "headline": any(headlines) if headlines else None,
        "sizes": covered_by(hidden, own) if cause_of(hidden["name"]).sized else [],
    }


def _holds(told: dict[str, Any], hidden: dict[str, Any]) -> bool:
    """What is told has the hidden cause as a part of it, on one of its joints."""
    return hidden["name"] in cause_of(told["name"]).within and bool(set(told["joints"]) & set(hidden["joints"]))


def _ratio(document: dict[str, Any], baseline: FloatArray) -> FloatArray | None:
    """Held-out error over that of the baseline, shape (n,); None where nothing was judged."""
    after = np.array((document.get("torque_rmse") or {}).get("after") or [], dtype=float)
    if after.shape != baseline.shape or not np.any(after):
        return None
    return np.asarray(after / np.maximum(baseline, 1e-12))


def real_measures(rows: list[dict[str, Any]]) -> dict[str, float]:
    """The numbers of the level ``real``."""
    judged = [r for r in rows if r.get("verdict") != "error"]
    larger = [mark | {"refused": r["refused"]} for r in judged for mark in r["larger"]]
    ratios = [x for r in judged if r["ratio"] is not None for x in r["ratio"]]
    told = sum(r["claimed"] for r in judged)
    headlines = [mark["headline"] for mark in larger if mark["headline"] is not None]
    return {
        "refused": _mean([r["refused"] for r in judged] + [True] * (len(rows) - len(judged))),
        "named": _mean([mark["named"] and not mark["refused"] for mark in larger]),
        "headline": _mean(headlines),
        "covered": _mean([c for r in judged for _, c in r["sizes"]]),
        "false": sum(len(r["extra"]) for r in judged) / told if told else 0.0,
        "worse": _mean([bool(r["worse"]) for r in judged]),
        "worse joints": _mean([x > WORSE for x in ratios]),
        "ratio": float(np.median(ratios)) if ratios else float("nan"),
        "seconds": float(np.median([r["diagnose_s"] for r in judged])) if judged else float("nan"),
    }


def _mean(values: list[Any]) -> float:
    return float(np.mean(values)) if values else float("nan")


def render_real(rows: list[dict[str, Any]]) -> str:
    """Per larger cause, then false claims, then the numbers."""
    lines = [f"{'larger cause':30s} {'n':>3s} {'named':>6s} {'cover':>6s} {'refused':>8s}   told where it was not named"]
    judged = [r for r in rows if r.get("verdict") != "error"]
    marks = [(mark, r) for r in judged for mark in r["larger"]]
    for id_ in sorted({mark["name"] for mark, _ in marks}):
        own = [(mark, r) for mark, r in marks if mark["name"] == id_]
        sizes = [c for mark, _ in own for _, c in mark["sizes"]]
        missed = ["refused" if r["refused"] else " + ".join(r["named"]) or r["verdict"] for mark, r in own if not mark["named"]]
        refused = sum(r["refused"] for _, r in own)
        named = _mean([mark["named"] for mark, _ in own])
        lines.append(f"{id_:30s} {len(own):3d} {named:6.2f} {_mean(sizes):6.2f} {refused:8d}   {'; '.join(missed)}")
    healthy = [r for r in judged if not r["larger"]]
    lines.append(f"{'(none)':30s} {len(healthy):3d} {'':6s} {'':6s} {sum(r['refused'] for r in healthy):8d}")
    counts = Counter(name.split(" ")[0] for r in judged for name in r["extra"])
    lines += ["", "false claims: " + ("; ".join(f"{name} x{count}" for name, count in counts.most_common()) or "none")]
    worse = Counter(r["arm"] for r in judged if r["worse"])
    lines += ["worse than the plain baseline: " + ("; ".join(f"{arm} x{count}" for arm, count in worse.most_common()) or "none")]
    lines += ["", "  ".join(f"{name} {value:.3f}" for name, value in real_measures(rows).items() if value == value)]
    return "\n".join(lines)
