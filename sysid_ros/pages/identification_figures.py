"""Figures of the identification's report: torque measured and predicted, and what is left of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from sysid_ros.identification.result import ResidualSeries
from sysid_ros.pages.residual_curves import class_means, spectrum
from sysid_ros.sample import FloatArray

INK, BLUE, ORANGE, GREEN, GREY, GRID = "#222222", "#0072B2", "#D55E00", "#009E73", "#B8B8B8", "#E6E9ED"
_CURVE_POINTS = 40_000
"""Points of all curves of measured and predicted torque: the file stays small whatever was recorded."""
_CLOUD_POINTS = 500
_PARTS = 4.0
"""Recordings of a joint are pieced together with a gap of this [s]."""


def torque_figure(series: ResidualSeries, joints: Sequence[str], units: Sequence[str], share: float = 1.0) -> str:
    """HTML of measured and predicted torque, and of the URDF alone, a joint a row over the time of one recording.

    Args:
        share: part of the file's points that this figure may take.
    """
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    n = len(joints)
    height = 135 * n + 90
    figure = make_subplots(n, 1, shared_xaxes=True, vertical_spacing=34 / height, subplot_titles=_titles(joints, units))
    figure.update_annotations(font_size=13, x=0.0, xanchor="left")
    keep = _thinned(len(series.t), max(round(share * _CURVE_POINTS / (3 * n)), 200))
    t = series.t[keep] - series.t[0]
    breaks = np.flatnonzero(np.diff(series.t[keep]) > 3.0 * np.median(np.diff(series.t[keep]))) + 1
    for j in range(n):
        for values, name, line in (
            (series.tau_nominal, "URDF alone", {"color": ORANGE, "width": 1, "dash": "dot"}),
            (series.tau_measured, "measured", {"color": INK, "width": 1.6}),
            (series.tau_predicted, "predicted", {"color": BLUE, "width": 1.4}),
        ):
            x, y = np.insert(t, breaks, np.nan), np.insert(values[keep, j], breaks, np.nan)
            shown = {"name": name, "legendgroup": name, "showlegend": j == 0, "hovertemplate": "%{y:.4g}"}
            figure.add_trace(go.Scattergl(x=_small(x), y=_small(y), mode="lines", line=line, **shown), row=j + 1, col=1)
    figure.update_xaxes(title_text="time since the first stamp [s]", row=n, col=1)
    return _html(figure, height, hovermode="x unified")


def residual_figure(
    series: Sequence[ResidualSeries], joints: Sequence[str], units: Sequence[str], prismatic: Sequence[bool], cutoff_hz: float
) -> str:
    """HTML of the residual of all recordings against position, velocity, time and frequency, a joint a row.

    Points are samples, lines the mean over classes of equally many samples; rows in which the joint hardly moves are grey.
    """
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    n = len(joints)
    height = 170 * n + 110
    heads = [name for pair in zip(joints, [""] * n, [""] * n, [""] * n, strict=True) for name in pair]
    figure = make_subplots(
        n, 4, vertical_spacing=62 / height, horizontal_spacing=0.05, subplot_titles=heads, column_widths=[0.24, 0.24, 0.3, 0.22]
    )
    residual = np.concatenate([s.residual for s in series])
    moving = np.concatenate([s.moving for s in series])
    start = np.cumsum([0.0, *(s.t[-1] - s.t[0] + _PARTS for s in series[:-1])])
    for j in range(n):
        row = j + 1
        limit = 1.15 * float(np.quantile(np.abs(residual[:, j]), 0.995)) + 1e-12
        for column, channel in ((1, "q"), (2, "v")):
            x = np.concatenate([getattr(s, channel) for s in series])[:, j]
            for where, colour, opacity in ((~moving[:, j], GREY, 0.6), (moving[:, j], BLUE, 0.35)):
                chosen = np.flatnonzero(where)
                chosen = chosen[_thinned(len(chosen), _CLOUD_POINTS)]
                marker = {"color": colour, "size": 3, "opacity": opacity}
                figure.add_trace(_cloud(go, x[chosen], residual[chosen, j], marker), row=row, col=column)
            centre, mean = class_means(x[moving[:, j]], residual[moving[:, j], j])
            figure.add_trace(_curve(go, centre, mean, {"color": INK, "width": 1.8}), row=row, col=column)
        for s, offset in zip(series, start, strict=True):
            keep = _peaks(s.residual[:, j], max(_CURVE_POINTS // (3 * n * len(series)), 200))
            x = s.t[keep] - s.t[0] + offset
            figure.add_trace(_curve(go, x, s.residual[keep, j], {"color": BLUE, "width": 1}), row=row, col=3)
        for values, colour in (("tau_measured", GREY), ("residual", BLUE)):
            frequency, density = spectrum([getattr(s, values)[:, j] for s in series], [s.t for s in series], series[0].period)
            shown = frequency <= 1.5 * cutoff_hz
            figure.add_trace(_curve(go, frequency[shown], density[shown], {"color": colour, "width": 1.5}), row=row, col=4)
        for column in (1, 2, 3):
            figure.update_yaxes(range=[-limit, limit], row=row, col=column)
        figure.update_yaxes(title_text=f"residual [{units[j]}]", row=row, col=1)
        figure.update_yaxes(type="log", exponentformat="power", dtick=1, row=row, col=4)
        length = "m" if prismatic[j] else "rad"
        for column, text in enumerate((f"position [{length}]", f"velocity [{length}/s]", "time [s]", "frequency [Hz]"), start=1):
            figure.update_xaxes(title_text=text, title_standoff=2, row=row, col=column)
    figure.update_annotations(font_size=13, xanchor="left")
    for k, annotation in enumerate(a for a in figure.layout.annotations if a.text in joints):
        annotation.update(x=0.0, text=f"<b>{joints[k]}</b>")
    figure.update_xaxes(title_font_size=11, tickfont_size=10)
    figure.update_yaxes(title_font_size=11, tickfont_size=10)
    return _html(figure, height, showlegend=False)


def _titles(joints: Sequence[str], units: Sequence[str]) -> list[str]:
    return [f"<b>{name}</b> [{unit}]" for name, unit in zip(joints, units, strict=True)]


def _cloud(go: Any, x: FloatArray, y: FloatArray, marker: dict[str, Any]) -> Any:
    return go.Scattergl(x=_small(x), y=_small(y), mode="markers", marker=marker, hoverinfo="skip")


def _curve(go: Any, x: FloatArray, y: FloatArray, line: dict[str, Any]) -> Any:
    return go.Scatter(x=_small(x), y=_small(y), mode="lines", line=line, hovertemplate="%{x:.3g}: %{y:.3g}<extra></extra>")


def _html(figure: Any, height: int, **layout: Any) -> str:
    figure.update_xaxes(showgrid=True, gridcolor=GRID, zeroline=False)
    figure.update_yaxes(showgrid=True, gridcolor=GRID, zeroline=False)
    legend = {"orientation": "h", "x": 0.0, "xanchor": "left", "y": 1.0 + 26.0 / height, "yanchor": "bottom"}
    figure.update_layout(
        height=height, template="plotly_white", margin={"l": 60, "r": 12, "t": 60, "b": 50}, legend=legend, font_size=12, **layout
    )
    page: str = figure.to_html(full_html=False, include_plotlyjs=False, config={"displaylogo": False, "responsive": True})
    return page


def _small(values: FloatArray) -> Any:
    """Single precision, which takes half the room in the file."""
    return np.asarray(values, dtype=np.float32)


def _thinned(count: int, most: int) -> np.ndarray[Any, Any]:
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)) if count else np.zeros(0, dtype=int)


def _peaks(values: FloatArray, most: int) -> np.ndarray[Any, Any]:
    """Indices of at most ``most`` points that keep every peak: the least and the greatest of each stretch."""
    if values.size <= most:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, most // 2 + 1).astype(int)
    return np.unique([a + f(values[a:b]) for a, b in pairwise(edges) for f in (np.argmin, np.argmax)])
