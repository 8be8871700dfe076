"""The figure of an estimation as an interactive page by plotly, with all it needs inside."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.pages import palette
from sysid_ros.pages.payload_curves import (
    BELIEVED,
    Panel,
    Span,
    event_text,
    longest_step,
    payload_panels,
    relative_times,
    residual_limit,
    status_spans,
    with_gaps,
)
from sysid_ros.pages.truth import TruthSegment
from sysid_ros.sample import FloatArray

_MOST_POINTS = 5000
_LABEL_WIDTH = 0.15
"""Part of the axis that an event's label takes."""
_DASH = {"solid": "solid", "dashed": "dash", "dashdot": "dashdot", "dotted": "dot"}


def payload_page(
    series: Sequence[PayloadEstimate],
    events: Sequence[PayloadEvent],
    joint_names: Sequence[str],
    units: Sequence[str],
    title: str,
    truth: Sequence[TruthSegment],
) -> str:
    """HTML of the page: the panels of the figure one below the other, zoomed together; times since the first estimate."""
    t, spans = relative_times(series), status_spans(series)
    panels = payload_panels(series, truth)
    n = len(joint_names)
    heights = [36.0, 190.0, 220.0, 220.0] + [85.0] * n
    titles = [""] + [f"{p.title} [{p.unit}]" for p in panels]
    titles += [f"Residual of {name} [{unit}]" for name, unit in zip(joint_names, units, strict=True)]
    space = 34.0
    total = sum(heights) + space * (len(heights) - 1)
    figure = make_subplots(
        rows=len(heights), cols=1, shared_xaxes=True, row_heights=heights, vertical_spacing=space / total, subplot_titles=titles
    )
    figure.update_annotations(font_size=13, x=0.0, xanchor="left")
    _add_strip(figure, spans)
    keep, longest = _thinned(t.size), longest_step(t) * max(1.0, 2.0 * t.size / _MOST_POINTS)
    for row, panel in enumerate(panels, start=2):
        _add_panel(figure, row, panel, t, keep, longest, truth, series[0].t)
    residual = np.array([e.residual for e in series])
    for j in range(n):
        peaks = _peaks(residual[:, j])
        x, y = with_gaps(longest, t[peaks], residual[peaks, j])
        line = {"color": "#0072B2", "width": 1}
        figure.add_trace(go.Scatter(x=x, y=y, name=joint_names[j], line=line, showlegend=False), row=5 + j, col=1)
        limit = 1.3 * residual_limit(residual[:, j])
        figure.update_yaxes(range=[-limit, limit], row=5 + j, col=1)
    _mark(figure, spans, [(e.t - series[0].t, e) for e in events])
    figure.update_xaxes(range=[0.0, spans[-1].end], showgrid=True, gridcolor=palette.GRID, zeroline=False)
    figure.update_xaxes(title_text=f"time since stamp {series[0].t:.3f} [s]", showticklabels=True, row=4 + n, col=1)
    figure.update_yaxes(showgrid=True, gridcolor=palette.GRID, zeroline=False)
    figure.update_yaxes(visible=False, range=[0.0, 1.0], fixedrange=True, row=1, col=1)
    subtitle = f"frame {series[0].frame}, inertia along its axes; bands: 95 % interval{'; dashed: truth' if truth else ''}"
    height = int(total) + 230
    figure.update_layout(
        title={
            "text": f"<b>{_escape(title)}</b><br><sup>{_escape(subtitle)}</sup>",
            "x": 0.01,
            "y": 1.0 - 28.0 / height,
            "yref": "container",
        },
        height=height,
        template="plotly_white",
        margin={"l": 70, "r": 20, "t": 140, "b": 60},
        legend={"orientation": "h", "y": 1.0 - 62.0 / height, "yref": "container", "yanchor": "top", "x": 0.0, "xanchor": "left"},
        hovermode="x unified",
    )
    page: str = figure.to_html(full_html=True, include_plotlyjs=True, config={"displaylogo": False, "responsive": True})
    return page.replace("<head>", f"<head><title>{_escape(title)}</title>", 1)


def _add_strip(figure: Any, spans: Sequence[Span]) -> None:
    for status in dict.fromkeys(span.status for span in spans):
        x: list[float | None] = []
        y: list[float | None] = []
        for span in spans:
            if span.status == status:
                x += [span.start, span.end, span.end, span.start, span.start, None]
                y += [0.0, 0.0, 1.0, 1.0, 0.0, None]
        colour = _status_colour(status)
        box = go.Scatter(
            x=x, y=y, fill="toself", fillcolor=colour, mode="lines", line={"width": 0}, name=status, hoverinfo="skip"
        )
        figure.add_trace(box, row=1, col=1)


def _add_panel(
    figure: Any,
    row: int,
    panel: Panel,
    t: FloatArray,
    keep: np.ndarray[Any, Any],
    longest: float,
    truth: Sequence[TruthSegment],
    start: float,
) -> None:
    for curve in panel.curves:
        colour = palette.CURVES[curve.label]
        x, value, band = with_gaps(longest, t[keep], curve.value[keep], curve.band[keep])
        # plotly fills across gaps, but not across the end of a polygon
        edge: list[FloatArray] = []
        along: list[FloatArray] = []
        end = np.array([np.nan])
        for stretch in _stretches(np.isfinite(value) & np.isfinite(band)):
            edge += [(value + band)[stretch], (value - band)[stretch][::-1], end]
            along += [x[stretch], x[stretch][::-1], end]
        if edge:
            outline = {
                "x": np.concatenate(along),
                "y": np.concatenate(edge),
                "mode": "lines",
                "line": {"width": 0},
                "fill": "toself",
            }
            shown = {"legendgroup": f"{row}{curve.label}", "showlegend": False, "hoverinfo": "skip"}
            figure.add_trace(go.Scatter(**outline, **shown, fillcolor=_faint(colour, 0.2)), row=row, col=1)
        figure.add_trace(
            go.Scatter(
                x=x,
                y=value,
                customdata=band,
                name=curve.label,
                line={"color": colour, "width": 2},
                showlegend=len(panel.curves) > 1,
                legendgroup=f"{row}{curve.label}",
                hovertemplate="%{y:.4g} ± %{customdata:.2g} " + panel.unit,
            ),
            row=row,
            col=1,
        )
        for segment, true in zip(truth, curve.truth, strict=True):
            if np.isfinite(true):
                line = {"color": palette.INK, "width": 1.5, "dash": "dash"}
                ends = [segment.start - start, segment.end - start]
                figure.add_trace(
                    go.Scatter(
                        x=ends, y=[true, true], mode="lines", line=line, name="truth", legendgroup="truth", hoverinfo="skip",
                        showlegend=row == 2 and segment is truth[0],
                    ), row=row, col=1,
                )  # fmt: skip
    figure.update_yaxes(range=list(panel.limits), row=row, col=1)
    if not any(np.isfinite(c.value).any() for c in panel.curves):
        middle = {"x": 0.5, "y": 0.5, "xref": "x domain", "yref": "y domain"}
        figure.add_annotation(text="not determined by these data", showarrow=False, **middle, row=row, col=1)


def _mark(figure: Any, spans: Sequence[Span], marks: Sequence[tuple[float, PayloadEvent]]) -> None:
    # set at once: plotly's add_vline copies every shape that is there already, for each of the panels
    everywhere = {"xref": "x", "yref": "paper", "y0": 0.0, "y1": 1.0}
    shapes: list[dict[str, Any]] = [
        {"type": "rect", "x0": span.start, "x1": span.end, "layer": "below", "line": {"width": 0}, **everywhere}
        | {"fillcolor": _faint(_status_colour(span.status), 0.13)}
        for span in spans
        if span.status not in BELIEVED
    ]
    labels: list[dict[str, Any]] = []
    free_from = -np.inf
    for when, event in marks:
        dash = _DASH[palette.EVENT_DASH.get(event.kind, "dashdot")]
        line = {"color": palette.EVENT.get(event.kind, palette.INK), "dash": dash, "width": 1}
        shapes.append({"type": "line", "x0": when, "x1": when, "line": line, **everywhere})
        if when >= free_from:
            place = {"x": when, "xref": "x", "xanchor": "left", "y": 1.0, "yref": "paper", "yanchor": "bottom"}
            labels.append({"text": event_text(event), "showarrow": False, "font": {"size": 12}, **place})
            free_from = when + _LABEL_WIDTH * spans[-1].end
    figure.update_layout(shapes=shapes, annotations=[*figure.layout.annotations, *labels])


def _thinned(count: int) -> np.ndarray[Any, Any]:
    """Indices of at most ``_MOST_POINTS`` points, evenly."""
    return np.unique(np.linspace(0, count - 1, min(count, _MOST_POINTS)).round().astype(int))


def _peaks(values: FloatArray) -> np.ndarray[Any, Any]:
    """Indices of at most ``_MOST_POINTS`` points that keep every peak: the least and the greatest of each stretch."""
    if values.size <= _MOST_POINTS:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, _MOST_POINTS // 2 + 1).astype(int)
    found = [a + f(values[a:b]) for a, b in pairwise(edges) for f in (np.argmin, np.argmax)]
    return np.unique(found)


def _stretches(there: np.ndarray[Any, Any]) -> list[slice]:
    """Slices in which ``there`` holds without a break."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _faint(colour: str, opacity: float) -> str:
    r, g, b = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({r}, {g}, {b}, {opacity})"


def _status_colour(status: str) -> str:
    return palette.STATUS.get(status, palette.UNKNOWN_STATUS)


def _escape(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
