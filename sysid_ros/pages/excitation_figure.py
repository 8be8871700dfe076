"""The figure of an excitation by matplotlib, for a report."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sysid_ros.excitation.excite import Excitation
from sysid_ros.pages import palette
from sysid_ros.pages.excitation_curves import COLOURS, KINDS, TITLES, Curves, curves, headline, used


def excitation_figure(excitation: Excitation, title: str) -> Figure:
    """Positions, and the used part of the other limits, over time; criteria and margins beside them."""
    shown, names = curves(excitation), excitation.limits.robot.joint_names
    figure = Figure(figsize=(13.0, 8.6))
    FigureCanvasAgg(figure)
    columns = figure.add_gridspec(1, 2, width_ratios=[1.9, 1.0], left=0.06, right=0.985, top=0.87, bottom=0.1, wspace=0.3)
    left = columns[0].subgridspec(4, 1, hspace=0.28)
    panels = [figure.add_subplot(left[0])]
    panels += [figure.add_subplot(left[i], sharex=panels[0]) for i in (1, 2, 3)]
    _draw_positions(panels[0], shown, names)
    for kind, axes in enumerate(panels[1:], start=1):
        _draw_use(axes, shown, kind)
    panels[-1].set_xlabel("time from start [s]", fontsize=9)
    panels[0].set_xlim(0.0, shown.t[-1])
    right = columns[1].subgridspec(2, 1, height_ratios=[0.55, 1.0], hspace=0.35)
    _draw_criteria(figure.add_subplot(right[0]), excitation)
    _draw_used(figure.add_subplot(right[1]), excitation)
    for axes in panels:
        axes.tick_params(labelsize=8, colors=palette.INK, labelbottom=axes is panels[-1])
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color=palette.GRID, linewidth=0.6)
    figure.align_ylabels(panels)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="lower left", bbox_to_anchor=(0.055, 0.005), ncols=min(len(names), 7), fontsize=8, frameon=False
    )
    figure.suptitle(title, x=0.06, y=0.98, ha="left", va="top", fontsize=13, fontweight="bold", color=palette.INK)
    figure.text(0.06, 0.945, headline(excitation), ha="left", va="top", fontsize=9, color="#555555")
    return figure


def _draw_positions(axes: Axes, shown: Curves, names: tuple[str, ...]) -> None:
    for j, name in enumerate(names):
        axes.plot(shown.t, shown.q[:, j], color=COLOURS[j % len(COLOURS)], linewidth=1.2, label=name)
    axes.set_title(f"Position [{shown.position_unit}]", loc="left", fontsize=10, color=palette.INK)


def _draw_use(axes: Axes, shown: Curves, kind: int) -> None:
    for j in range(shown.q.shape[1]):
        axes.plot(shown.t, 100.0 * shown.use[kind, :, j], color=COLOURS[j % len(COLOURS)], linewidth=1.2)
    for limit in (-100.0, 100.0):
        axes.axhline(limit, color=palette.INK, linewidth=0.9, linestyle="dashed")
    axes.set_ylim(-112.0, 112.0)
    axes.set_yticks([-100, -50, 0, 50, 100])
    axes.set_title(f"{TITLES[KINDS[kind]]} [% of what is allowed]", loc="left", fontsize=10, color=palette.INK)


def _draw_criteria(axes: Axes, excitation: Excitation) -> None:
    d = [c.d for c in excitation.random if np.isfinite(c.d)]
    axes.plot(d, np.zeros(len(d)), "|", color="#555555", markersize=18, label=f"{len(d)} random feasible motions")
    axes.plot([excitation.criteria.d], [0.0], "D", color="#009E73", markersize=9, label="this motion")
    axes.set_ylim(-1.0, 1.4)
    axes.set_yticks([])
    axes.spines[["left", "top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8, colors=palette.INK)
    axes.legend(fontsize=8, frameon=False, loc="upper left", ncols=2)
    axes.set_title("D: log det of the information, more is better", loc="left", fontsize=10, color=palette.INK)


def _draw_used(axes: Axes, excitation: Excitation) -> None:
    parts, names = 100.0 * used(excitation), excitation.limits.robot.joint_names
    limited = np.isfinite(excitation.limits.effort)
    axes.imshow(parts, cmap="Blues", vmin=0.0, vmax=130.0, aspect="auto")
    for i in range(parts.shape[0]):
        for k in range(parts.shape[1]):
            text = f"{parts[i, k]:.0f}" if k != KINDS.index("torque") or limited[i] else "–"
            axes.text(k, i, text, ha="center", va="center", fontsize=9, color="white" if parts[i, k] > 75.0 else palette.INK)
    axes.set_xticks(range(len(KINDS)), [TITLES[k].split()[-1].capitalize() for k in KINDS], fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.tick_params(length=0, colors=palette.INK)
    axes.spines[:].set_visible(False)
    axes.set_title("Largest use of what is allowed [%]", loc="left", fontsize=10, color=palette.INK)
    if excitation.pairs:
        k = int(np.argmin(excitation.use.room))
        nearest = " and ".join(excitation.pairs[k])
        axes.set_xlabel(
            f"nearest to a collision: {nearest},\n{1e3 * excitation.use.room[k]:.1f} mm more than they must keep", fontsize=8
        )
