"""The figure of an estimation: status, events, what was estimated with its bands, and what the torque leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.online.carried import Carried
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.online.replay import Replay
from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Band, Curve, Dash, Figure, Item, Mark, Panel, Spans, Stack, evenly, peaks, with_gaps
from sysid_ros.pages.page import VIEW_SUFFIXES, check_plot_path, write_plot
from sysid_ros.pages.payload_curves import (
    BELIEVED,
    Quantities,
    Quantity,
    Span,
    TruthSegment,
    event_text,
    last_known,
    longest_step,
    payload_quantities,
    relative_times,
    status_spans,
)
from sysid_ros.pages.payload_view import payload_view
from sysid_ros.pages.robot_view import View
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_MOST_POINTS = 5000
_COLOURS = {"mass": palette.BLUE, "x": palette.BLUE, "y": palette.ORANGE, "z": palette.GREEN}
_COLOURS |= {f"I{axis}{axis}": _COLOURS[axis] for axis in "xyz"}


def write_payload_plot(
    path: Path,
    series: Sequence[PayloadEstimate],
    events: Sequence[PayloadEvent],
    joint_names: Sequence[str],
    title: str,
    truth: Sequence[TruthSegment] | None = None,
    effort_units: Sequence[str] | None = None,
    carried: Sequence[Carried] = (),
    view: View | None = None,
) -> None:
    """Write mass, centre of mass, inertia with their 95 % bands, status, events and residual torques over time.

    Args:
        path: .png, .svg or .pdf for a report; .html for a page that holds all it needs.
        series: estimates in the order of time.
        events: picks, drops and other changes.
        joint_names: n names, the order of the residuals.
        title: of the figure.
        truth: what was really carried, where that is known.
        effort_units: unit of each joint's residual, "N m" where it is left out.
        carried: what was carried, in order. view: of the robot that carried it, for a page.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there.
        DataError: the series is empty, or its residuals belong to another number of joints.
    """
    check_plot_path(path)
    if not series:
        raise DataError("There is no estimate to plot. Give data that yield one: some seconds in which the joints move.")
    n = series[0].residual.size
    units = tuple(effort_units) if effort_units is not None else ("N m",) * n
    if len(joint_names) != n or len(units) != n:
        raise DataError(
            f"The estimates have residuals of {n} joints; {len(joint_names)} names and {len(units)} units were given. Give {n}."
        )
    figure = payload_figure(series, events, joint_names, units, title, truth or (), carried)
    tables = _bodies(series[0].t, carried) + _events(series, events)
    write_plot(path, figure, answer=_answer(series, carried), tiles=_tiles(series, events), tables=tables, view=view)


def write_replay(path: Path, result: Replay, robot: RobotModel, title: str, urdf: Path | None = None) -> None:
    """Write what a replay gave, as :func:`write_payload_plot`; a page also shows the robot.

    Args:
        urdf: the robot's file, beside which meshes are looked for.
    """
    check_plot_path(path)
    seen = payload_view(robot, urdf, result) if path.suffix.lower() in VIEW_SUFFIXES else None
    units = tuple("N" if slides else "N m" for slides in robot.is_prismatic)
    write_payload_plot(path, result.series, result.events, robot.joint_names, title, None, units, result.payloads, seen)


def payload_figure(
    series: Sequence[PayloadEstimate],
    events: Sequence[PayloadEvent],
    joint_names: Sequence[str],
    units: Sequence[str],
    title: str,
    truth: Sequence[TruthSegment],
    carried: Sequence[Carried] = (),
) -> Figure:
    """Estimates on the left, one residual a joint on the right; times since the first estimate."""
    t, spans, known = relative_times(series), status_spans(series), last_known(series, events)
    time = Axis(f"time since stamp {series[0].t:.3f} [s]", (0.0, max(spans[-1].end, 1e-3)), clock=True)
    marks = [_mark(e.t - series[0].t, e) for e in events]
    behind: tuple[Item, ...] = (*_shades(spans), *(replace(mark, text="") for mark in marks))
    estimates = [_strip(spans, marks, time)]
    estimates += [_panel(q, t, known, truth, series[0].t, behind, time) for q in payload_quantities(series, truth)]
    residual = np.array([e.residual for e in series])
    left = [_residual(t, residual[:, j], joint_names[j], units[j], behind, time) for j in range(len(joint_names))]
    values = "" if known is None else f"; numbers: the last estimate of status ok, at {series[known].t - series[0].t:.2f} s"
    subtitle = f"Frame {series[0].frame}, inertia along its axes; bands and ±: 95 % interval{values}"
    masses = [f"{c.estimate.mass:.3f} ± {1.96 * c.estimate.mass_std:.3f} kg" for c in carried]
    if masses:
        times = [f"{c.t0 - series[0].t:.2f} to {c.t1 - series[0].t:.2f} s" for c in carried]
        subtitle += "; carried: " + ", ".join(f"{mass} from {when}" for mass, when in zip(masses, times, strict=True))
    return Figure(
        (
            Stack(tuple(estimates), width=1.75, least=500.0),
            Stack(tuple(left), "Residual torque (measured − predicted)", least=330.0),
        ),
        title,
        subtitle + ("; dashed: truth" if truth else ""),
        columns=2,
        width=1320.0,
        legends=True,
    )


def _strip(spans: Sequence[Span], marks: Sequence[Mark], time: Axis) -> Panel:
    """Coloured status below, labelled events above it."""
    present = [s for s in palette.STATUS if any(span.status == s for span in spans)]
    present += sorted({span.status for span in spans} - set(palette.STATUS))
    items: list[Item] = []
    for status in present:
        x = np.array([v for s in spans if s.status == status for v in (s.start, s.end, np.nan)])
        top = np.where(np.isfinite(x), 0.3, np.nan)
        items.append(Band(x, 0.0 * top, top, status, palette.of_status(status), 1.0))
    return Panel((*items, *marks), "Status and events", x=time, y=Axis(limits=(0.0, 1.0), ticks=()), height=72.0)


def _mark(t: float, event: PayloadEvent) -> Mark:
    colour, dash = palette.EVENT.get(event.kind, (palette.INK, "dashdot"))
    return Mark("x", t, event_text(event), colour=colour, dash=cast(Dash, dash))


def _panel(
    of: Quantities,
    t: FloatArray,
    last: int | None,
    truth: Sequence[TruthSegment],
    start: float,
    behind: tuple[Item, ...],
    time: Axis,
) -> Panel:
    keep, longest = evenly(t.size, _MOST_POINTS), longest_step(t) * max(1.0, 2.0 * t.size / _MOST_POINTS)
    items: list[Item] = []
    for quantity in of.quantities:
        colour = _COLOURS[quantity.label]
        x, value, band = with_gaps(longest, t[keep], quantity.value[keep], quantity.band[keep])
        # a marker shows what is too short for a line
        few = np.count_nonzero(np.isfinite(value)) < 3
        items.append(Band(x, value - band, value + band, "95 %", colour))
        items.append(Curve(x, value, quantity.at(last), colour, marker="dot" if few else ""))
    items += [c for quantity in of.quantities for c in _truth(quantity, truth, start)]
    nothing = not any(np.isfinite(q.value).any() for q in of.quantities)
    y = Axis(limits=of.limits, ticks=() if nothing else None)
    within = "not determined by these data" if nothing else ""
    return Panel((*behind, *items), f"{of.title} [{of.unit}]", x=time, y=y, height=165.0, within=within)


def _truth(quantity: Quantity, truth: Sequence[TruthSegment], start: float) -> list[Curve]:
    ends = [(s.start - start, s.end - start, true) for s, true in zip(truth, quantity.truth, strict=True) if np.isfinite(true)]
    x = np.array([v for begin, end, _ in ends for v in (begin, end, np.nan)])
    y = np.array([v for *_, true in ends for v in (true, true, np.nan)])
    return [Curve(x, y, "truth", palette.INK, 1.1, "dashed")] if ends else []


def _residual(t: FloatArray, residual: FloatArray, name: str, unit: str, behind: tuple[Item, ...], time: Axis) -> Panel:
    at = peaks(residual, _MOST_POINTS)
    x, y = with_gaps(longest_step(t) * max(1.0, 2.0 * t.size / _MOST_POINTS), t[at], residual[at])
    zero = Mark("y", 0.0, colour=palette.SOFT, width=0.6)
    rms = float(np.sqrt(np.mean(residual**2)))
    # one peak does not squash the rest
    limit = max(1.7 * float(np.quantile(np.abs(residual), 0.995)), 1.3e-3)
    items = (*behind, zero, Curve(x, y, colour=palette.BLUE, width=0.7))
    return Panel(items, f"{name} [{unit}]", f"rms {rms:.2g} {unit}", time, Axis(limits=(-limit, limit)), 60.0)


def _shades(spans: Sequence[Span]) -> list[Spans]:
    """What is not believed, behind all curves."""
    doubtful = dict.fromkeys(span.status for span in spans if span.status not in BELIEVED)
    parts = {status: [s for s in spans if s.status == status] for status in doubtful}
    return [
        Spans("x", np.array([s.start for s in part]), np.array([s.end for s in part]), colour=palette.of_status(status))
        for status, part in parts.items()
    ]


def _tiles(series: Sequence[PayloadEstimate], events: Sequence[PayloadEvent]) -> list[tuple[str, str]]:
    """The numbers of the last estimate that no event had overtaken."""
    known = last_known(series, events)
    if known is None:
        return [(series[-1].status.replace("_", " "), "status at the end; no estimate of status ok")]
    e = series[known]
    com = ", ".join(f"{1e3 * x:.1f}" for x in e.com)
    return [
        (f"{e.mass:.3f} ± {1.96 * e.mass_std:.3f} kg", f"mass, 95 %, at {e.t - series[0].t:.2f} s, the last of status ok"),
        (f"{com} mm", f"centre of mass in {e.frame}; 95 %: ± {', '.join(f'{1.96e3 * x:.1f}' for x in e.com_std)}"),
        (series[-1].status.replace("_", " "), "status at the end"),
    ]


def _answer(series: Sequence[PayloadEstimate], carried: Sequence[Carried]) -> str:
    """What was carried, in words."""
    if not carried:
        return f"Nothing that was carried was found: {series[-1].status.replace('_', ' ')} at the end."
    told = []
    for c in carried:
        e, span = c.estimate, f"from {c.t0 - series[0].t:.2f} to {c.t1 - series[0].t:.2f} s"
        doubt = "" if e.status == "ok" else f" ({e.status.replace('_', ' ')})"
        com = ", ".join(f"{1e3 * x:.0f}" for x in e.com).replace("-", "−")
        told.append(f"{e.mass:.3f} ± {1.96 * e.mass_std:.3f} kg {span}, centre of mass at {com} mm in {e.frame}{doubt}")
    return f"Carried: {'; '.join(told)}. Times count from the first estimate."


def _bodies(start: float, carried: Sequence[Carried]) -> list[dict[str, Any]]:
    rows = []
    for c in carried:
        e, std = c.estimate, c.inertia_std
        com = [f"{1e3 * x:.1f} ± {1.96e3 * s:.1f}" for x, s in zip(e.com, e.com_std, strict=True)]
        inertia = [f"{e.inertia_com[k, k]:.4f} ± {1.96 * std[k, k]:.4f}" for k in range(3)]
        mass = f"{e.mass:.3f} ± {1.96 * e.mass_std:.3f}"
        rows.append((f"{c.t0 - start:.2f}", f"{c.t1 - start:.2f}", mass, *com, *inertia, e.status))
    head = ("from [s]", "to [s]", "mass [kg]", "com x [mm]", "y", "z", "Ixx at com [kg m²]", "Iyy", "Izz", "status")
    note = "One row for each thing, with 95 % intervals; inertia about its centre of mass. Times since the first estimate."
    return [{"title": "Carried", "note": note, "head": head, "rows": rows}] if rows else []


def _events(series: Sequence[PayloadEstimate], events: Sequence[PayloadEvent]) -> list[dict[str, Any]]:
    rows = [(e.kind, f"{e.t - series[0].t:.2f}", f"{e.mass_before:.3f}", f"{e.mass_after:.3f}") for e in events]
    head = ("event", "time [s]", "mass before [kg]", "mass after [kg]")
    return [{"title": "Events", "note": "Times since the first estimate.", "head": head, "rows": rows}] if rows else []
