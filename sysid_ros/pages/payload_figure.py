"""The figure of an estimation by matplotlib, without its global state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.pages import palette
from sysid_ros.pages.payload_curves import (
    BELIEVED,
    Panel,
    Span,
    event_text,
    last_known,
    longest_step,
    payload_panels,
    relative_times,
    residual_limit,
    status_spans,
    with_gaps,
)
from sysid_ros.pages.truth import TruthSegment
from sysid_ros.sample import FloatArray

_WIDTH, _HEIGHT = 13.5, 9.0
_LABEL_ROWS = 3
_LABEL_WIDTH = 0.17
"""Part of the axis that an event's label takes."""


def payload_figure(
    series: Sequence[PayloadEstimate],
    events: Sequence[PayloadEvent],
    joint_names: Sequence[str],
    units: Sequence[str],
    title: str,
    truth: Sequence[TruthSegment],
) -> Figure:
    """Estimates on the left, one residual a joint on the right, status and events above; times since the first estimate."""
    t, spans = relative_times(series), status_spans(series)
    known = last_known(series, events)
    marks = [(e.t - series[0].t, e) for e in events]
    end = max(spans[-1].end, 1e-3)
    n = len(joint_names)
    figure = Figure(figsize=(_WIDTH, max(_HEIGHT, 2.0 + 0.75 * n)))
    FigureCanvasAgg(figure)
    columns = figure.add_gridspec(1, 2, width_ratios=[1.75, 1.0], left=0.062, right=0.985, top=0.89, bottom=0.062, wspace=0.15)
    left = columns[0].subgridspec(4, 1, height_ratios=[0.42, 1.0, 1.2, 1.2], hspace=0.27)
    strip = figure.add_subplot(left[0])
    panels = [figure.add_subplot(left[i], sharex=strip) for i in (1, 2, 3)]
    right = columns[1].subgridspec(n, 1, hspace=0.12)
    joints = [figure.add_subplot(right[j], sharex=strip) for j in range(n)]

    _draw_strip(strip, spans, marks, end)
    for axes, panel in zip(panels, payload_panels(series, truth), strict=True):
        _draw_panel(axes, panel, t, known, truth, series[0].t)
    residual = np.array([e.residual for e in series])
    for j, axes in enumerate(joints):
        _draw_residual(axes, t, residual[:, j], joint_names[j], units[j])
    joints[0].set_title("Residual torque (measured − predicted)", loc="left", fontsize=10, color=palette.INK)
    for axes in (*panels, *joints):
        _shade(axes, spans)
        for when, event in marks:
            axes.axvline(when, color=_event_colour(event), linestyle=_event_dash(event), linewidth=0.9, zorder=1.5)
    for axes in (strip, *panels, *joints):
        last = axes is panels[-1] or axes is joints[-1]
        axes.tick_params(labelsize=8, labelbottom=last, colors=palette.INK)
        axes.spines[["top", "right"]].set_visible(False)
        if last:
            axes.set_xlabel(f"time since stamp {series[0].t:.3f} [s]", fontsize=9)
    strip.set_xlim(0.0, end)
    figure.align_ylabels(panels)
    figure.align_ylabels(joints)
    figure.suptitle(title, x=0.062, y=0.982, ha="left", va="top", fontsize=13, fontweight="bold", color=palette.INK)
    figure.text(0.062, 0.949, _subtitle(series, known, bool(truth)), ha="left", va="top", fontsize=9, color="#555555")
    return figure


def _subtitle(series: Sequence[PayloadEstimate], known: int | None, with_truth: bool) -> str:
    values = "" if known is None else f"; numbers: the last estimate of status ok, at {series[known].t - series[0].t:.2f} s"
    truth = "; dashed: truth" if with_truth else ""
    return f"Frame {series[0].frame}, inertia along its axes; bands and ±: 95 % interval{values}{truth}"


def _draw_strip(axes: Axes, spans: Sequence[Span], marks: Sequence[tuple[float, PayloadEvent]], end: float) -> None:
    """Coloured status below, labelled events above it."""
    for span in spans:
        axes.axvspan(span.start, span.end, ymax=0.34, color=_status_colour(span.status), linewidth=0)
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks([0.17], ["status"])
    axes.tick_params(axis="y", length=0)
    axes.set_title("Status and events", loc="left", fontsize=10, color=palette.INK)
    present = [s for s in palette.STATUS if any(span.status == s for span in spans)]
    present += sorted({span.status for span in spans} - set(palette.STATUS))
    axes.legend(
        handles=[Patch(color=_status_colour(s), label=s) for s in present],
        loc="lower right", bbox_to_anchor=(1.0, 0.98), ncol=len(present), frameon=False, fontsize=8,
        handlelength=1.2, columnspacing=1.2, borderaxespad=0.0,
    )  # fmt: skip
    taken = [-np.inf] * _LABEL_ROWS
    for when, event in marks:
        axes.axvline(when, color=_event_colour(event), linestyle=_event_dash(event), linewidth=0.9)
        row = next((r for r in range(_LABEL_ROWS) if taken[r] <= when), None)
        if row is None:
            continue
        width = _LABEL_WIDTH * end
        at_right = when + width > end
        axes.annotate(
            event_text(event),
            (when, 0.86 - 0.21 * row), xytext=(-3 if at_right else 3, 0), textcoords="offset points",
            ha="right" if at_right else "left", va="center", fontsize=7.5, color=_event_colour(event),
        )  # fmt: skip
        taken[row] = when + width * (0.2 if at_right else 1.0)


def _draw_panel(axes: Axes, panel: Panel, t: FloatArray, last: int | None, truth: Sequence[TruthSegment], start: float) -> None:
    handles: list[Line2D | Patch] = []
    for curve in panel.curves:
        colour = palette.CURVES[curve.label]
        x, value, band = with_gaps(longest_step(t), t, curve.value, curve.band)
        axes.fill_between(x, value - band, value + band, color=colour, alpha=0.2, linewidth=0, zorder=2)
        # a marker shows what is too short for a line
        few = np.count_nonzero(np.isfinite(value)) < 3
        axes.plot(x, value, color=colour, linewidth=1.4, zorder=3, marker="o" if few else None, markersize=4)
        handles.append(Line2D([], [], color=colour, linewidth=1.4, label=curve.at(last)))
        for segment, true in zip(truth, curve.truth, strict=True):
            if np.isfinite(true):
                ends = (segment.start - start, segment.end - start)
                axes.plot(ends, (true, true), color=palette.INK, linewidth=1.0, linestyle=(0, (5, 3)), zorder=4)
    handles.append(Patch(color="#777777", alpha=0.35, linewidth=0, label="95 %"))
    if truth:
        handles.append(Line2D([], [], color=palette.INK, linewidth=1.0, linestyle=(0, (5, 3)), label="truth"))
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.99), ncol=len(handles), frameon=False, fontsize=8,
        handlelength=1.6, columnspacing=1.2, borderaxespad=0.0,
    )  # fmt: skip
    axes.set_title(panel.title, loc="left", fontsize=10, color=palette.INK)
    axes.set_ylabel(f"[{panel.unit}]", fontsize=9)
    axes.set_ylim(*panel.limits)
    axes.grid(True, color=palette.GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    if not any(np.isfinite(c.value).any() for c in panel.curves):
        axes.set_yticks([])
        axes.text(0.5, 0.5, "not determined by these data", transform=axes.transAxes, ha="center", va="center", color="#555555")


def _draw_residual(axes: Axes, t: FloatArray, residual: FloatArray, name: str, unit: str) -> None:
    limit = residual_limit(residual)
    x, value, _ = with_gaps(longest_step(t), t, residual, residual)
    axes.axhline(0.0, color="#999999", linewidth=0.6, zorder=1)
    axes.plot(x, value, color="#0072B2", linewidth=0.6, zorder=3)
    axes.set_ylim(-1.5 * limit, 1.5 * limit)
    axes.set_ylabel(f"[{unit}]", fontsize=8)
    axes.locator_params(axis="y", nbins=3)
    rms = float(np.sqrt(np.mean(residual**2)))
    axes.text(0.01, 0.97, name, transform=axes.transAxes, fontsize=8, va="top", color=palette.INK)
    axes.text(0.99, 0.97, f"rms {rms:.2g} {unit}", transform=axes.transAxes, fontsize=8, va="top", ha="right", color="#555555")


def _shade(axes: Axes, spans: Sequence[Span]) -> None:
    for span in spans:
        if span.status not in BELIEVED:
            axes.axvspan(span.start, span.end, color=_status_colour(span.status), alpha=0.13, linewidth=0, zorder=0)


def _status_colour(status: str) -> str:
    return palette.STATUS.get(status, palette.UNKNOWN_STATUS)


def _event_colour(event: PayloadEvent) -> str:
    return palette.EVENT.get(event.kind, palette.INK)


def _event_dash(event: PayloadEvent) -> str:
    return palette.EVENT_DASH.get(event.kind, "dashdot")
