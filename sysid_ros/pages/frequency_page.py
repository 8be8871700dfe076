"""The Bode diagrams of a frequency check as an interactive page by plotly, with all it needs inside."""

from __future__ import annotations

import html

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from sysid_ros.frequency import FrequencyCheck
from sysid_ros.frequency.tolerances import TOLERANCES
from sysid_ros.pages import palette
from sysid_ros.pages.frequency_curves import FITTED, MEASURED, SAYS, bode, short, shown, span

_AREA = "rgba(0, 114, 178, 0.2)"
_HELD = "rgba(0, 158, 115, 0.12)"


def frequency_page(result: FrequencyCheck, title: str) -> str:
    """HTML of the page: for each joint magnitude, phase and coherence, one joint below the other, and the findings."""
    checks = shown(result)
    low, high = span(checks)
    titles = [x for c in checks for x in (f"{html.escape(c.joint)}: {html.escape(short(c))}", "", "")]
    figure = make_subplots(
        rows=3 * len(checks),
        cols=1,
        shared_xaxes=True,
        row_heights=[1.0, 0.8, 0.4] * len(checks),
        vertical_spacing=min(0.02, 0.2 / (3 * len(checks))),
        subplot_titles=titles,
    )
    figure.update_annotations(font_size=13, x=0.0, xanchor="left")
    for i, check in enumerate(checks):
        assert check.torque is not None
        curves, row = bode(check.torque), 3 * i + 1
        limit = float(np.degrees(np.arcsin(TOLERANCES.misfit)))
        bands = ((curves.magnitude, 1.0 - TOLERANCES.misfit, 1.0 + TOLERANCES.misfit), (curves.phase, -limit, limit))
        for k, (values, least, most) in enumerate(bands):
            figure.add_hrect(y0=least, y1=most, fillcolor=_HELD, line_width=0, row=row + k, col=1)
            seen = np.isfinite(values).all(axis=0)
            f = curves.f[seen]
            area = {"x": np.concatenate([f, f[::-1]]), "y": np.concatenate([values[2][seen], values[1][seen][::-1]])}
            figure.add_trace(
                go.Scatter(**area, fill="toself", fillcolor=_AREA, line={"width": 0}, hoverinfo="skip", showlegend=False),
                row=row + k,
                col=1,
            )
            line = {"color": MEASURED, "width": 1.5}
            figure.add_trace(
                go.Scatter(
                    x=f,
                    y=values[0][seen],
                    mode="lines+markers",
                    marker={"size": 4},
                    line=line,
                    name="response, with 95 % region",
                    legendgroup="response",
                    showlegend=i == 0 and k == 0,
                ),
                row=row + k,
                col=1,
            )
            fitted = curves.fit_magnitude if k == 0 else curves.fit_phase
            figure.add_trace(
                go.Scatter(
                    x=curves.fit_f,
                    y=fitted,
                    line={"color": FITTED, "width": 2},
                    name="cause that was found",
                    legendgroup="cause",
                    showlegend=i == 0 and k == 0,
                ),
                row=row + k,
                col=1,
            )
        for a, b, says in curves.bands:
            figure.add_vrect(x0=max(a, low), x1=b, fillcolor=SAYS[says], opacity=0.25, line_width=0, row=row + 2, col=1)
        figure.add_trace(
            go.Scatter(x=curves.f, y=curves.coherence, line={"color": "#555555", "shape": "hvh"}, showlegend=False),
            row=row + 2,
            col=1,
        )
        figure.update_yaxes(type="log", title="magnitude", row=row, col=1)
        figure.update_yaxes(range=[-190.0, 190.0], tickvals=[-180, -90, 0, 90, 180], title="phase [°]", row=row + 1, col=1)
        figure.update_yaxes(range=[0.0, 1.05], title="coherence", row=row + 2, col=1)
    figure.update_xaxes(type="log", range=[np.log10(low), np.log10(high)], showgrid=True, gridcolor=palette.GRID)
    figure.update_xaxes(title="frequency [Hz]", row=3 * len(checks), col=1)
    figure.update_layout(
        title={"text": f"<b>{html.escape(title)}</b>", "x": 0.02},
        height=180 + 520 * len(checks),
        template="simple_white",
        margin={"t": 110, "l": 90, "r": 30},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 1.0, "xanchor": "right"},
    )
    page: str = figure.to_html(include_plotlyjs=True, full_html=True)
    findings = "".join(
        f"<li>{html.escape(s)}</li>" for s in (*result.sentences, *(x for c in result.joints for x in c.sentences))
    )
    style = "font-family: sans-serif; max-width: 1000px; margin: 1em 2em; color: #222222"
    return page.replace("<body>", f'<body><div style="{style}"><h2>Findings</h2><ul>{findings}</ul></div>', 1)
