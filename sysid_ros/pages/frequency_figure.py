"""The Bode diagrams of a frequency check by matplotlib, for a report."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from sysid_ros.frequency import FrequencyCheck, JointCheck
from sysid_ros.frequency.tolerances import TOLERANCES
from sysid_ros.pages import palette
from sysid_ros.pages.frequency_curves import FITTED, LARGEST, MEASURED, SAYS, SMALLEST, Bode, bode, short, shown, span

_MOST_PER_ROW = 4
_HELD = "#E3F1EC"


def frequency_figure(result: FrequencyCheck, title: str) -> Figure:
    """For each joint magnitude, phase and coherence over frequency, up to four joints in a row."""
    checks = shown(result)
    rows = -(-len(checks) // _MOST_PER_ROW)
    columns = -(-len(checks) // rows)
    width, height = 1.4 + 3.9 * columns, 2.0 + 5.1 * rows
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        rows,
        columns,
        left=0.75 / width,
        right=1.0 - 0.2 / width,
        top=1.0 - 1.45 / height,
        bottom=0.85 / height,
        wspace=0.17,
        hspace=0.3,
    )
    low, high = span(checks)
    for i, check in enumerate(checks):
        row, column = divmod(i, columns)
        _draw_joint(figure, grid[row, column], check, (low, high), column == 0, i + columns >= len(checks))
    handles = [
        Line2D([], [], color=MEASURED, linewidth=1.4, marker="o", markersize=3, label="response, with 95 % region"),
        Line2D([], [], color=FITTED, linewidth=1.6, label="cause that was found"),
        Patch(color=_HELD, label=f"within {100.0 * TOLERANCES.misfit:.0f} % of 1"),
        *(Patch(color=colour, label=f"band: {says}") for says, colour in SAYS.items()),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles) if columns > 2 else 3, fontsize=9, frameon=False)
    left = 0.75 / width
    figure.text(left, 1.0 - 0.22 / height, title, ha="left", va="top", fontsize=13, fontweight="bold", color=palette.INK)
    told = "1 says that the model holds; frequencies at which the motion does not stand clear of the noise are left out"
    figure.text(left, 1.0 - 0.52 / height, told, ha="left", va="top", fontsize=9.5, color="#555555")
    return figure


def _draw_joint(figure: Figure, place: object, check: JointCheck, ends: tuple[float, float], first: bool, lowest: bool) -> None:
    assert check.torque is not None
    curves = bode(check.torque)
    parts = place.subgridspec(4, 1, height_ratios=[0.07, 1.25, 1.0, 0.55], hspace=0.1)  # type: ignore[attr-defined]
    strip, *panels = (figure.add_subplot(parts[k]) for k in range(4))
    _draw_strip(strip, curves, ends)
    strip.text(0.0, 3.9, check.joint, transform=strip.transAxes, fontsize=11, fontweight="bold", color=palette.INK, va="bottom")
    strip.text(0.0, 1.4, short(check), transform=strip.transAxes, fontsize=8.5, color="#444444", va="bottom")
    _draw_magnitude(panels[0], curves)
    _draw_phase(panels[1], curves)
    panels[2].step(curves.f, curves.coherence, where="mid", color="#555555", linewidth=1.1)
    panels[2].set_ylim(0.0, 1.03)
    panels[2].set_yticks([0.0, 0.5, 1.0])
    for axes, label in zip(panels, ("magnitude", "phase [°]", "coherence"), strict=True):
        axes.set_xscale("log")
        axes.set_xlim(*ends)
        _tick(axes, ends, axes is panels[-1])
        axes.grid(color=palette.GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8, colors=palette.INK, labelbottom=axes is panels[-1], labelleft=True)
        if first:
            axes.set_ylabel(label, fontsize=9, color=palette.INK)
            axes.yaxis.set_label_coords(-0.135, 0.5)
    if lowest:
        panels[-1].set_xlabel("frequency [Hz]", fontsize=9, color=palette.INK)


def _tick(axes: Axes, ends: tuple[float, float], labelled: bool) -> None:
    marks = [m for m in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0) if ends[0] <= m <= ends[1]]
    axes.xaxis.set_major_locator(FixedLocator(marks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}" if labelled else ""))


def _draw_strip(axes: Axes, curves: Bode, ends: tuple[float, float]) -> None:
    for low, high, says in curves.bands:
        axes.axvspan(max(low, ends[0]), min(high, ends[1]), color=SAYS[says], linewidth=0.0)
    axes.set_xscale("log")
    axes.set_xlim(*ends)
    axes.set_ylim(0.0, 1.0)
    axes.axis("off")


def _draw_magnitude(axes: Axes, curves: Bode) -> None:
    axes.axhspan(1.0 - TOLERANCES.misfit, 1.0 + TOLERANCES.misfit, color=_HELD, linewidth=0.0)
    axes.axhline(1.0, color="#888888", linewidth=0.8)
    axes.fill_between(curves.f, curves.magnitude[1], curves.magnitude[2], color=MEASURED, alpha=0.2, linewidth=0.0)
    axes.plot(curves.f, curves.magnitude[0], color=MEASURED, linewidth=1.3, marker="o", markersize=2.2)
    axes.plot(curves.fit_f, curves.fit_magnitude, color=FITTED, linewidth=1.6)
    axes.set_yscale("log")
    finite = np.concatenate([curves.magnitude[0][np.isfinite(curves.magnitude[0])], curves.fit_magnitude, [1.0]])
    axes.set_ylim(max(min(0.45, finite.min() / 1.4), SMALLEST), min(max(2.2, finite.max() * 1.4), LARGEST))
    axes.yaxis.set_major_locator(FixedLocator([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))


def _draw_phase(axes: Axes, curves: Bode) -> None:
    limit = np.degrees(np.arcsin(TOLERANCES.misfit))
    axes.axhspan(-limit, limit, color=_HELD, linewidth=0.0)
    axes.axhline(0.0, color="#888888", linewidth=0.8)
    axes.fill_between(curves.f, curves.phase[1], curves.phase[2], color=MEASURED, alpha=0.2, linewidth=0.0)
    axes.plot(curves.f, curves.phase[0], color=MEASURED, linewidth=1.3, marker="o", markersize=2.2)
    axes.plot(curves.fit_f, curves.fit_phase, color=FITTED, linewidth=1.6)
    axes.set_ylim(-190.0, 190.0)
    axes.set_yticks([-180, -90, 0, 90, 180])
