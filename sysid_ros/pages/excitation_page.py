"""The figure of an excitation as an interactive page by plotly, with all it needs inside."""

from __future__ import annotations

import html

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from sysid_ros.excitation.excite import Excitation
from sysid_ros.pages import palette
from sysid_ros.pages.excitation_curves import COLOURS, KINDS, TITLES, curves, headline, used


def excitation_page(excitation: Excitation, title: str) -> str:
    """HTML of the page: positions and the used part of the other limits over time, then criteria and margins."""
    shown, names = curves(excitation), excitation.limits.robot.joint_names
    titles = [f"Position [{shown.position_unit}]"]
    titles += [f"{TITLES[k]} [% of what is allowed]" for k in KINDS[1:]]
    titles += ["D of random feasible motions, and of this one (more is better)", "Largest use of what is allowed [%]"]
    figure = make_subplots(
        rows=6, cols=1, row_heights=[1.0, 1.0, 1.0, 1.0, 0.35, 0.28 * len(names)], vertical_spacing=0.05, subplot_titles=titles
    )
    figure.update_annotations(font_size=13, x=0.0, xanchor="left")
    for j, name in enumerate(names):
        line = {"color": COLOURS[j % len(COLOURS)], "width": 1.5}
        for kind in range(len(KINDS)):
            y = shown.q[:, j] if kind == 0 else 100.0 * shown.use[kind, :, j]
            trace = go.Scatter(x=shown.t, y=y, name=name, legendgroup=name, showlegend=kind == 0, line=line)
            figure.add_trace(trace, row=1 + kind, col=1)
    for row in (2, 3, 4):
        for limit in (-100.0, 100.0):
            figure.add_hline(y=limit, line={"color": palette.INK, "width": 1, "dash": "dash"}, row=row, col=1)
        figure.update_yaxes(range=[-112.0, 112.0], row=row, col=1)
    for row in (1, 2, 3, 4):
        figure.update_xaxes(matches="x", range=[0.0, shown.t[-1]], showgrid=True, gridcolor=palette.GRID, row=row, col=1)
    figure.update_xaxes(title="time from start [s]", row=4, col=1)
    d = [c.d for c in excitation.random]
    marks = {"symbol": "line-ns-open", "size": 16, "color": "#555555"}
    figure.add_trace(
        go.Scatter(x=d, y=[0.0] * len(d), mode="markers", marker=marks, name="random feasible", showlegend=False), row=5, col=1
    )
    mark = {"symbol": "diamond", "size": 12, "color": "#009E73"}
    figure.add_trace(
        go.Scatter(x=[excitation.criteria.d], y=[0.0], mode="markers", marker=mark, name="this motion", showlegend=False),
        row=5,
        col=1,
    )
    figure.update_yaxes(visible=False, row=5, col=1)
    parts = 100.0 * used(excitation)
    figure.add_trace(
        go.Heatmap(
            z=parts,
            x=list(KINDS),
            y=list(names),
            zmin=0.0,
            zmax=130.0,
            colorscale="Blues",
            showscale=False,
            texttemplate="%{z:.0f}",
        ),
        row=6,
        col=1,
    )
    figure.update_yaxes(autorange="reversed", row=6, col=1)
    text = f"<b>{html.escape(title)}</b><br><span style='font-size:13px'>{html.escape(headline(excitation))}</span>"
    figure.update_layout(
        title={"text": text, "x": 0.02},
        height=1150 + 25 * len(names),
        template="simple_white",
        margin={"t": 110, "l": 120, "r": 30},
    )
    page: str = figure.to_html(include_plotlyjs=True, full_html=True)
    return page
