"""What ``sysid excite`` tells: tables for people, a document for machines."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from sysid_ros.cli.output import report
from sysid_ros.excitation.criteria import Criteria
from sysid_ros.excitation.excitation_settings import ExcitationSettings
from sysid_ros.excitation.excite import Excitation
from sysid_ros.excitation.motion_limits import KINDS

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


def show(result: Excitation) -> None:
    """Criteria before and after, and what is used of the limits, on stdout."""
    console = report()
    names = result.limits.robot.joint_names
    before = (median(result.random), result.random[0])
    table = Table(
        title=f"Excitation of {len(result.parameters)} base parameters; before: {len(result.random)} random feasible motions",
        title_justify="left",
        box=box.SIMPLE,
    )
    for column in ("criterion", ""):
        table.add_column(column)
    for column in ("before,\nmedian", "before,\nbest D", "after"):
        table.add_column(column, justify="right")
    for criterion, meaning, name in _ROWS:
        table.add_row(criterion, meaning, *(f"{getattr(c, name):.4g}" for c in (*before, result.criteria)))
    console.print(table)
    motion = Table(title="Motion, and the part of what is allowed that it uses", title_justify="left", box=box.SIMPLE)
    motion.add_column("joint", no_wrap=True)
    motion.add_column("start\nrad or m", justify="right")
    for kind in KINDS:
        motion.add_column(f"{kind}\n%", justify="right")
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
            highlight=False,
        )
    console.print(f"Start, for --start: {','.join(f'{x:.6f}' for x in result.trajectory.start)}", highlight=False, soft_wrap=True)


def _distances(result: Excitation, pair: int) -> tuple[float, float]:
    keep = float(result.clearance[pair])
    return keep, float(result.use.room[pair]) + keep


def as_json(result: Excitation, settings: ExcitationSettings) -> dict[str, Any]:
    """The document for machines; infinite numbers are null."""
    trajectory, limits = result.trajectory, result.limits
    offset, sine, cosine = trajectory.basis.series(trajectory.coefficients)
    names = limits.robot.joint_names
    return {
        "robot": limits.robot.name,
        "joints": list(names),
        "settings": asdict(settings),
        "motion": {
            "duration": trajectory.duration,
            "period": trajectory.basis.period,
            "start": trajectory.start.tolist(),
            "equation": "q_j(t) = offset[j] + sum_l sine[l][j] sin((l+1) w t) + cosine[l][j] cos((l+1) w t), w = 2 pi / period",
            "offset": offset.tolist(),
            "sine": sine.tolist(),
            "cosine": cosine.tolist(),
        },
        "criteria": {
            "after": _criteria(result.criteria),
            "before_best": _criteria(result.random[0]),
            "before_median": _criteria(median(result.random)),
            "random_d": [_finite(c.d) for c in result.random],
            "search_d": [_finite(d) for d in result.start_d],
        },
        "base_parameters": list(result.parameters),
        "row_weights": result.weight.tolist(),
        "limits": {
            "lower": limits.lower.tolist(),
            "upper": limits.upper.tolist(),
            "velocity": limits.velocity.tolist(),
            "acceleration": limits.acceleration.tolist(),
            "effort": [_finite(x) for x in limits.effort],
        },
        "use": {kind: result.use.limits[k].tolist() for k, kind in enumerate(KINDS)},
        "pairs": [
            {"links": list(links), "distance": _distances(result, k)[1], "keep": _distances(result, k)[0]}
            for k, links in enumerate(result.pairs)
        ],
        "notes": list(result.notes),
        "warnings": list(result.warnings),
    }


def _criteria(criteria: Criteria) -> dict[str, float | None]:
    return {name: _finite(value) for name, value in asdict(criteria).items()}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
