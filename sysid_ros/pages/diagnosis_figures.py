"""Figures of a diagnosis: torque measured and predicted, and what the model leaves against everything that could explain it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sysid_ros.diagnosis.result import Predictions
from sysid_ros.diagnosis.trajectories import HORIZON, Trajectories
from sysid_ros.sample import FloatArray

_INK, _BLUE, _ORANGE, _GREY = "#222222", "#0072B2", "#D55E00", "#E6E9ED"
_BAND = 8.0
"""Upper end of the band that is judged [Hz]."""
_CURVE_POINTS = 4000
_CLOUD_POINTS = 700


def torque_figure(p: Predictions, units: Sequence[str]) -> str:
    """HTML of the measured torque, of the nominal and of the extended model, a joint a row."""
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    n = len(p.joints)
    height = 140 * n + 90
    titles = [f"{name} [{unit}]" for name, unit in zip(p.joints, units, strict=True)]
    figure = make_subplots(n, 1, shared_xaxes=True, vertical_spacing=34 / height, subplot_titles=titles)
    figure.update_annotations(font_size=13, x=0.0, xanchor="left")
    keep = _even(len(p.t), _CURVE_POINTS)
    breaks = np.flatnonzero(np.diff(p.t[keep]) > 3.0 * np.median(np.diff(p.t[keep]))) + 1
    lines = (
        (p.nominal, "nominal model", {"color": _ORANGE, "width": 1, "dash": "dot"}),
        (p.measured, "measured", {"color": _INK, "width": 1.6}),
        (p.extended, "extended model", {"color": _BLUE, "width": 1.3}),
    )
    for j in range(n):
        for values, name, line in lines:
            x, y = np.insert(p.t[keep], breaks, np.nan), np.insert(values[keep, j], breaks, np.nan)
            shown = {"name": name, "legendgroup": name, "showlegend": j == 0, "hovertemplate": "%{y:.4g}"}
            figure.add_trace(go.Scattergl(x=_small(x), y=_small(y), mode="lines", line=line, **shown), row=j + 1, col=1)
    figure.update_xaxes(title_text="time since the first stamp [s]", row=n, col=1)
    return _html(figure, height, hovermode="x unified")


def simulation_figure(driven: Trajectories, joints: Sequence[str]) -> str:
    """HTML of the simulated positions beside the measured ones, windows side by side, a joint a row."""
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    n = len(joints)
    height = 140 * n + 90
    figure = make_subplots(n, 1, shared_xaxes=True, vertical_spacing=34 / height, subplot_titles=[f"{j} [rad]" for j in joints])
    figure.update_annotations(font_size=13, x=0.0, xanchor="left")
    ends = np.flatnonzero(np.isnan(driven.t))
    firsts = np.concatenate([[0], ends[:-1] + 1])
    x, ticks = driven.t.copy(), []
    for k, (a, b) in enumerate(zip(firsts, ends, strict=True)):
        x[a:b] = driven.t[a:b] - driven.t[a] + 1.15 * k * HORIZON
        ticks.append((x[a], f"{driven.t[a]:.1f} s"))
    lines = (
        (driven.nominal, "nominal model", {"color": _ORANGE, "width": 1.2, "dash": "dot"}),
        (driven.measured, "measured", {"color": _INK, "width": 2.2}),
        (driven.extended, "extended model", {"color": _BLUE, "width": 1.4}),
    )
    for j in range(n):
        for values, name, line in lines:
            shown = {"name": name, "legendgroup": name, "showlegend": j == 0, "hovertemplate": "%{y:.4g}"}
            figure.add_trace(
                go.Scattergl(x=_small(x), y=_small(values[:, j]), mode="lines", line=line, **shown), row=j + 1, col=1
            )
        near = np.concatenate([driven.measured[:, j], driven.extended[:, j]])
        low, high = np.nanmin(near), np.nanmax(near)
        margin = 0.15 * (high - low) + 1e-3
        figure.update_yaxes(range=[low - margin, high + margin], row=j + 1, col=1)
    figure.update_xaxes(tickvals=[t for t, _ in ticks], ticktext=[text for _, text in ticks])
    return _html(figure, height, hovermode="x unified")


def residual_figure(p: Predictions, units: Sequence[str], floor: FloatArray) -> str:
    """HTML of the residual before and after, against position, velocity, acceleration, load, time, the temperature of the joint
    where one is known, and frequency.

    Args:
        floor: noise floor of each joint below 8 Hz, shape (n,) [N m].
    """
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    n = len(p.joints)
    height = 205 * n + 110
    warm = [] if p.temperature is None else ["temperature [°C]"]
    columns = (
        "position [rad]", "velocity [rad/s]", "acceleration", "load [N m]", "time [s]", *warm, "frequency [Hz]", "coherence [Hz]",
    )  # fmt: skip
    spectrum, coherence = len(columns) - 1, len(columns)
    titles = [
        f"{name} [{unit}]" if c == 0 else "" for name, unit in zip(p.joints, units, strict=True) for c in range(len(columns))
    ]
    figure = make_subplots(
        n, len(columns), shared_yaxes=False, vertical_spacing=58 / height, horizontal_spacing=0.035, subplot_titles=titles
    )
    figure.update_annotations(font_size=13, xanchor="left", x=0.0)
    keep = _even(len(p.t), _CLOUD_POINTS)
    before, after = p.measured - p.nominal, p.measured - p.extended
    for j in range(n):
        against = [p.q[:, j], p.v[:, j], p.a[:, j], p.nominal[:, j], p.t]
        if p.temperature is not None:
            against.append(p.temperature[:, j])
            if np.isnan(p.temperature[:, j]).all():
                figure.add_annotation(
                    text="not recorded", x=0.5, y=0.5, xref="x domain", yref="y domain", showarrow=False,
                    font={"color": "#777777"}, row=j + 1, col=6,
                )  # fmt: skip
                figure.update_xaxes(showticklabels=False, showgrid=False, row=j + 1, col=6)
                figure.update_yaxes(showticklabels=False, showgrid=False, zeroline=False, row=j + 1, col=6)
        for values, name, colour in ((before, "nominal model", _ORANGE), (after, "extended model", _BLUE)):
            shown = {"name": name, "legendgroup": name}
            marker = {"color": colour, "size": 3, "opacity": 0.45}
            for c, x in enumerate(against, start=1):
                cloud = go.Scattergl(
                    x=_small(x[keep]), y=_small(values[keep, j]), mode="markers", marker=marker,
                    showlegend=j == 0 and c == 1, hoverinfo="skip", **shown,
                )  # fmt: skip
                figure.add_trace(cloud, row=j + 1, col=c)
            f, density = _spectrum(values[:, j], p.t)
            line = go.Scattergl(
                x=_small(f), y=_small(density), mode="lines", line={"color": colour, "width": 1.2}, showlegend=False, **shown
            )
            figure.add_trace(line, row=j + 1, col=spectrum)
            f, share = _coherence(values[:, j], p.v[:, j], p.t)
            line = go.Scattergl(
                x=_small(f), y=_small(share), mode="lines", line={"color": colour, "width": 1.2}, showlegend=False, **shown
            )
            figure.add_trace(line, row=j + 1, col=coherence)
        level = float(floor[j]) / np.sqrt(_BAND)
        figure.add_hline(y=level, line={"color": _INK, "width": 1, "dash": "dot"}, row=j + 1, col=spectrum)
        figure.update_yaxes(type="log", row=j + 1, col=spectrum)
        figure.update_yaxes(range=[0.0, 1.0], row=j + 1, col=coherence)
    figure.update_xaxes(nticks=4, tickangle=0)
    for c, name in enumerate(columns, start=1):
        for row in {1, n}:
            figure.update_xaxes(title={"text": name, "font": {"size": 12}, "standoff": 4}, row=row, col=c)
    return _html(figure, height)


def _spectrum(values: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Amplitude density below 10 Hz, [N m / sqrt(Hz)]."""
    from scipy import signal

    rate = 1.0 / float(np.median(np.diff(t)))
    f, power = signal.welch(values, rate, nperseg=min(len(values), int(8.0 * rate)))
    below = (f > 0.0) & (f < 10.0)
    return f[below], np.sqrt(power[below])


def _coherence(values: FloatArray, motion: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Part of the power of values that goes along with a motion, below 10 Hz."""
    from scipy import signal

    rate = 1.0 / float(np.median(np.diff(t)))
    f, share = signal.coherence(values, motion, rate, nperseg=min(len(values) // 4, int(4.0 * rate)))
    below = (f > 0.0) & (f < 10.0)
    # 0/0 where one of the two has no power: nothing goes along with it there
    return f[below], np.nan_to_num(share[below])


def _even(count: int, most: int) -> np.ndarray[Any, Any]:
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _small(values: FloatArray) -> Any:
    return np.asarray(values, dtype=np.float32)


def _html(figure: Any, height: int, **layout: Any) -> str:
    figure.update_layout(
        height=height,
        template="plotly_white",
        margin={"l": 55, "r": 15, "t": 60, "b": 50},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 1.0, "xanchor": "right", "itemsizing": "constant"},
        **layout,
    )
    figure.update_xaxes(gridcolor=_GREY, zeroline=False)
    figure.update_yaxes(gridcolor=_GREY, zerolinecolor="#C5CBD3")
    page: str = figure.to_html(full_html=False, include_plotlyjs=False, config={"displaylogo": False, "responsive": True})
    return page
