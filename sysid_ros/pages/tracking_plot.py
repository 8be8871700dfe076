"""write_tracking_plot: the tip's error and the believed mass of control laws over time, as a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sysid_ros.control.tracking_run import TrackingRun
from sysid_ros.pages import palette
from sysid_ros.pages.payload_plot import PAGE_SUFFIXES, check_plot_path

COLOURS = ("#555555", "#0072B2", "#D55E00", "#009E73", "#CC79A7")
_LEAST = 1e-3
"""Errors below this are drawn there, on a logarithmic axis [mm]."""


def write_tracking_plot(path: Path, runs: Sequence[TrackingRun], events: Sequence[tuple[float, str]], mass: float) -> None:
    """Write errors and masses of several runs of the same scenario.

    Args:
        path: .png, .svg or .pdf for a report; .html for a page that holds all it needs. events: t [s] and kind. mass: that is
            carried between pick and drop [kg].

    Raises:
        SettingsError: the suffix is not known, or the folder is not there.
    """
    check_plot_path(path)
    truth = _carried(events, mass, max(float(run.t[-1]) for run in runs))
    if path.suffix.lower() in PAGE_SUFFIXES:
        _page(path, runs, events, truth)
    else:
        _figure(path, runs, events, truth)


def _carried(events: Sequence[tuple[float, str]], mass: float, end: float) -> tuple[list[float], list[float]]:
    """Corners of the true mass over time."""
    times, masses = [0.0], [0.0]
    for t, kind in sorted(events):
        times += [t, t]
        masses += [masses[-1], mass if kind == "pick" else 0.0]
    return [*times, end], [*masses, masses[-1]]


def _label(law: str) -> str:
    return law.replace("_", " ").replace("slotine li", "Slotine-Li")


def _figure(
    path: Path, runs: Sequence[TrackingRun], events: Sequence[tuple[float, str]], truth: tuple[list[float], list[float]]
) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    error, mass = figure.subplots(2, 1, sharex=True, height_ratios=[1.5, 1.0])
    for run, colour in zip(runs, COLOURS, strict=False):
        error.semilogy(run.t, np.maximum(1e3 * run.tip_error, _LEAST), color=colour, lw=1.2, label=_label(run.law))
        mass.plot(run.t, run.mass, color=colour, lw=1.4)
    mass.plot(*truth, color=palette.INK, lw=1.0, ls=(0, (2, 2)), label="truth")
    for axis in (error, mass):
        axis.grid(color=palette.GRID, lw=0.6)
        axis.set_axisbelow(True)
        for side in ("top", "right"):
            axis.spines[side].set_visible(False)
        for t, _ in events:
            axis.axvline(t, color=palette.INK, lw=0.8)
    for t, kind in events:
        error.annotate(kind, (t, 1.0), xycoords=("data", "axes fraction"), xytext=(3, -3), textcoords="offset points", va="top")
    error.set_ylabel("distance of the tip from its path [mm]")
    mass.set_ylabel("mass that the law believes in [kg]")
    mass.set_xlabel("time [s]")
    handles, labels = error.get_legend_handles_labels()
    more, words = mass.get_legend_handles_labels()
    figure.legend(handles + more, labels + words, loc="outside upper center", ncols=6, frameon=False)
    figure.savefig(path, dpi=150)


def _page(
    path: Path, runs: Sequence[TrackingRun], events: Sequence[tuple[float, str]], truth: tuple[list[float], list[float]]
) -> None:
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, row_heights=[0.6, 0.4], vertical_spacing=0.06)
    for run, colour in zip(runs, COLOURS, strict=False):
        line, name = {"color": colour, "width": 1.5}, _label(run.law)
        figure.add_scatter(
            x=run.t, y=np.maximum(1e3 * run.tip_error, _LEAST), line=line, name=name, legendgroup=name, row=1, col=1
        )
        figure.add_scatter(x=run.t, y=run.mass, line=line, name=name, legendgroup=name, showlegend=False, row=2, col=1)
    figure.add_trace(go.Scatter(x=truth[0], y=truth[1], line={"color": palette.INK, "dash": "dot"}, name="truth"), row=2, col=1)
    for t, kind in events:
        figure.add_vline(t, line_width=1, annotation_text=kind)
    figure.update_yaxes(title_text="tip from its path [mm]", type="log", row=1, col=1)
    figure.update_yaxes(title_text="believed mass [kg]", row=2, col=1)
    figure.update_xaxes(title_text="time [s]", row=2, col=1)
    figure.update_layout(template="simple_white", height=760, hovermode="x unified")
    figure.write_html(path, include_plotlyjs=True)
