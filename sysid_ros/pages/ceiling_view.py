"""The ceiling as reports show it: its sentence, and a table of joints and black boxes."""

from __future__ import annotations

from typing import Any

from sysid_ros.blackbox.ceiling_result import Ceiling
from sysid_ros.blackbox.rest_boxes import BOXES


def ceiling_view(found: Ceiling | None) -> dict[str, Any] | None:
    """What the macro ``ceiling`` takes: sentence, headings and rows of text; None without a ceiling."""
    if found is None:
        return None
    rows = []
    for j in found.joints:
        missing, best = (
            _percent(x) + ("" if between is None else f" ({_percent(between[0])} to {_percent(between[1])})")
            for x, between in ((j.missing, j.missing_interval), (j.gain, j.interval))
        )
        chance = "" if j.p_value is None else f"{j.p_value:.2g}"
        told = "yes" if j.claimed else "no" if j.left is not None else "not judged"
        rows.append([j.joint, _percent(j.left), missing, best, chance, told, *(_percent(j.boxes.get(b.name)) for b in BOXES)])
    return {
        "sentence": found.sentence,
        "head": ["joint", "left", "missing", "predicted", "by chance", "told", *(b.name for b in BOXES)],
        "rows": rows,
    }


def _percent(part: float | None) -> str:
    return "" if part is None else f"{100.0 * part:.2g}"
