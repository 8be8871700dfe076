"""What ``sysid excite`` tells: tables for people, a document for machines."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from rich.console import Console

from sysid_ros.cli.output import report, table
from sysid_ros.excitation.criteria import Criteria
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.excite import Excitation
from sysid_ros.excitation.motion_limits import KINDS
from sysid_ros.files import plain

_EQUATION = "q_j(t) = offset[j] + sum_l sine[l][j] sin((l+1) w t) + cosine[l][j] cos((l+1) w t), w = 2 pi / period"
_ROWS = (
    ("D", "log det of the information, more is better", "d"),
    ("A", "mean variance, less is better", "a"),
    ("E", "smallest eigenvalue, more is better", "e"),
    ("condition", "of the scaled, weighted columns", "condition_number"),
    ("condition", "of the scaled columns, joints alike", "unweighted_condition_number"),
)


def median(random: tuple[Criteria, ...]) -> Criteria:
    """Each criterion's own median."""
    return Criteria(**{name: float(np.median([getattr(c, name) for c in random])) for name in asdict(random[0])})


def show(result: Excitation, console: Console | None = None) -> None:
    """Criteria before and after, and what is used of the limits, on stdout."""
    console = console or report()
    names = result.limits.robot.joint_names
    before = (median(result.random), result.random[0])
    title = f"Excitation of {len(result.parameters)} base parameters; before: {len(result.random)} random feasible motions"
    out = table(title, "criterion", "", "before,\nmedian", "before,\nbest D", "after", words=["criterion", ""])
    for criterion, meaning, name in _ROWS:
        out.add_row(criterion, meaning, *(f"{getattr(c, name):.4g}" for c in (*before, result.criteria)))
    console.print(out)
    title = "Motion, and the part of what is allowed that it uses"
    motion = table(title, "joint", "start\nrad or m", *(f"{kind}\n%" for kind in KINDS))
    for i, name in enumerate(names):
        cells = [f"{100.0 * result.use.limits[k, i]:.1f}" for k in range(len(KINDS))]
        if np.isinf(result.limits.effort[i]):
            cells[-1] = "no limit"
        motion.add_row(name, f"{result.trajectory.start[i]:.4f}", *cells)
    console.print(motion)
    if result.pairs:
        k = int(np.argmin(result.use.room))
        keep, distance = _distances(result, k)
        console.print(
            f"Nearest to a collision of {len(result.pairs)} pairs: {' and '.join(result.pairs[k])}, {1e3 * distance:.1f} mm "
            f"apart ({1e3 * keep:.1f} mm to keep)",
        )
    console.print(f"Start, for --start: {','.join(f'{x:.6f}' for x in result.trajectory.start)}", soft_wrap=True)


def _distances(result: Excitation, pair: int) -> tuple[float, float]:
    keep = float(result.clearance[pair])
    return keep, float(result.use.room[pair]) + keep


def as_json(result: Excitation, settings: ExcitationSettings) -> dict[str, Any]:
    """The document for machines; infinite numbers are null."""
    trajectory, limits = result.trajectory, result.limits
    offset, sine, cosine = trajectory.basis.series(trajectory.coefficients)
    document: dict[str, Any] = plain(
        {
            "robot": limits.robot.name,
            "joints": limits.robot.joint_names,
            "settings": settings,
            "motion": {
                "duration": trajectory.duration,
                "period": trajectory.basis.period,
                "start": trajectory.start,
                "equation": _EQUATION,
                "offset": offset,
                "sine": sine,
                "cosine": cosine,
            },
            "criteria": {
                "after": result.criteria,
                "before_best": result.random[0],
                "before_median": median(result.random),
                "random_d": [c.d for c in result.random],
                "search_d": result.start_d,
            },
            "base_parameters": result.parameters,
            "row_weights": result.weight,
            "limits": {kind: getattr(limits, kind) for kind in ("lower", "upper", "velocity", "acceleration", "effort")},
            "use": dict(zip(KINDS, result.use.limits, strict=True)),
            "pairs": [
                {"links": links, "distance": _distances(result, k)[1], "keep": _distances(result, k)[0]}
                for k, links in enumerate(result.pairs)
            ],
            "notes": result.notes,
            "warnings": result.warnings,
        }
    )
    return document
