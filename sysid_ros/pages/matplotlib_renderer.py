"""Draws a figure by matplotlib, without its global state, for PNG, SVG and PDF."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib import figure as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Band, Cells, Curve, Figure, Item, Key, Mark, Spans, Way, keys
from sysid_ros.pages.layout import HEAD, LETTER, NOTE, ROW, Place, fitting, mark_texts, places, shortened, ticks_on

_PER_INCH = 100.0
_POINT = 72.0 / _PER_INCH
_EDGE = 14.0
_MARKERS = {"": "", "dot": "o", "bar": "|", "diamond": "D"}
_DASHES: dict[str, Any] = {"solid": "solid", "dashed": (0, (5, 3)), "dashdot": "dashdot", "dotted": (0, (1.5, 2))}


def drawn(figure: Figure) -> mpl.Figure:
    """The figure, with its title, legend and all panels."""
    placed, height = places(figure, figure.width)
    subtitle = textwrap.wrap(figure.subtitle, int(figure.width / LETTER))
    legend = [] if figure.legends else keys([p for s in figure.stacks for p in s.panels])
    per_row = max(1, int(figure.width // (LETTER * max((len(k.label) for k in legend), default=1) + 50.0)))
    head = _EDGE + 24.0 + NOTE * len(subtitle) + 20.0 * -(-len(legend) // per_row) + 6.0
    wide, tall = figure.width + 2.0 * _EDGE, head + height + _EDGE
    out = mpl.Figure(figsize=(wide / _PER_INCH, tall / _PER_INCH), dpi=_PER_INCH)
    FigureCanvasAgg(out)
    out.text(_EDGE / wide, 1.0 - _EDGE / tall, _plain(figure.title), va="top", fontsize=12, fontweight="bold", color=palette.INK)
    y = 1.0 - (_EDGE + 22.0) / tall
    out.text(_EDGE / wide, y, _plain("\n".join(subtitle)), va="top", fontsize=8.5, color="#555555")
    if legend:
        below = (_EDGE / wide, y - NOTE * len(subtitle) / tall)
        out.legend(handles=[_handle(k) for k in legend], loc="upper left", bbox_to_anchor=below, ncols=per_row, **_LEGEND)
    firsts: dict[int, Axes] = {}
    for place in placed:
        box = (_EDGE + place.left, tall - head - place.top - place.height, place.width, place.height)
        shared = firsts.get(place.stack) if figure.stacks[place.stack].shared else None
        axes = out.add_axes((box[0] / wide, box[1] / tall, box[2] / wide, box[3] / tall), sharex=shared)
        firsts.setdefault(place.stack, axes)
        _panel(axes, place, figure.legends)
    return out


_LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 8, "handlelength": 1.6, "columnspacing": 1.4, "borderaxespad": 0.0}


def _panel(axes: Axes, place: Place, legend: bool) -> None:
    panel = place.panel
    axes.margins(x=0.01)
    for item in panel.items:
        _draw(axes, item, place.margin)
    _scale(axes, "x", panel.x, place.width, place.axis)
    _scale(axes, "y", panel.y, place.height, True)
    axes.tick_params(labelsize=8, colors=palette.INK)
    if panel.x.ticks == () or not place.axis:
        axes.tick_params(axis="x", labelbottom=False, length=0)
    axes.spines[["top", "right"]].set_visible(False)
    if panel.y.ticks == ():
        axes.spines["left"].set_visible(False)
    axes.set_axisbelow(True)
    if any(isinstance(item, Cells) for item in panel.items):
        axes.spines[:].set_visible(False)
        axes.tick_params(length=0)
    else:
        axes.grid(True, color=palette.GRID, linewidth=0.6)
    if place.axis and panel.x.label:
        axes.set_xlabel(_plain(panel.x.label), fontsize=8.5, color=palette.INK, labelpad=2)
    axes.set_title(_plain(place.title), loc="left", fontsize=9, color=palette.INK, pad=4)
    axes.set_title(_plain(panel.note), loc="right", fontsize=8, color="#555555", pad=4)
    if legend and (entries := keys([panel])):
        axes.legend(
            handles=[_handle(k) for k in entries], loc="lower right", bbox_to_anchor=(1.0, 1.01), ncols=len(entries), **_LEGEND
        )
    if panel.within:
        middle: dict[str, Any] = {"transform": axes.transAxes, "ha": "center", "va": "center"}
        axes.text(0.5, 0.5, _plain(panel.within), color="#555555", fontsize=9, **middle)
    _texts(axes, place)


def _texts(axes: Axes, place: Place) -> None:
    """What stands beside marks, and the heading of the stack."""
    by: dict[str, Any] = {"textcoords": "offset points", "annotation_clip": False}
    for mark, row, before in mark_texts(place):
        at, away = axes.get_xaxis_transform(), (-3.0 if before else 3.0, -(row + 0.5) * ROW * _POINT)
        style: dict[str, Any] = {"ha": "right" if before else "left", "va": "center", "fontsize": 7.5, "color": mark.colour}
        axes.annotate(_plain(mark.text), (mark.at, 1.0), xycoords=at, xytext=away, **by, **style)
    above = HEAD + 3.0 if place.panel.title or place.panel.note else 3.0
    for k, line in enumerate(reversed(place.heading)):
        first = k == len(place.heading) - 1
        style = {"fontsize": 10, "fontweight": "bold", "color": palette.INK} if first else {"fontsize": 8.5, "color": "#555555"}
        away = (0.0, (above + k * NOTE) * _POINT)
        axes.annotate(_plain(line), (0.0, 1.0), xycoords="axes fraction", xytext=away, va="bottom", **by, **style)


def _draw(axes: Axes, item: Item, margin: float) -> None:
    match item:
        case Curve():
            style: dict[str, Any] = {"linestyle": _DASHES[item.dash] if item.width else "none", "linewidth": item.width}
            style |= {"marker": _MARKERS[item.marker], "markersize": _POINT * item.size, "alpha": item.opacity}
            if item.marker != "bar":
                style |= {"markeredgewidth": 0.0}
            axes.plot(item.x, item.y, color=item.colour, drawstyle="steps-mid" if item.step else "default", **style)
        case Band():
            axes.fill_between(item.x, item.low, item.high, color=item.colour, alpha=item.opacity, linewidth=0.0)
        case Spans():
            ends = np.column_stack([item.start, item.end, np.full(len(item.start), np.nan)]).ravel()
            fill = axes.fill_between if item.axis == "x" else axes.fill_betweenx
            across = axes.get_xaxis_transform() if item.axis == "x" else axes.get_yaxis_transform()
            fill(ends, 0.0, 1.0, color=item.colour, alpha=item.opacity, linewidth=0.0, transform=across)
        case Mark():
            line = axes.axvline if item.axis == "x" else axes.axhline
            line(item.at, color=item.colour, linewidth=item.width, linestyle=_DASHES[item.dash])
        case Cells():
            _cells(axes, item, margin)


def _cells(axes: Axes, item: Cells, margin: float) -> None:
    axes.imshow(
        item.values, cmap=LinearSegmentedColormap.from_list("cells", palette.CELLS), vmin=0.0, vmax=item.most, aspect="auto"
    )
    for (i, k), value in np.ndenumerate(item.values):
        colour = "white" if value > 0.5 * item.most else palette.INK
        axes.text(k, i, _plain(item.texts[i][k]), ha="center", va="center", fontsize=8.5, color=colour)
    axes.set_xticks(range(len(item.columns)), [_plain(name) for name in item.columns])
    axes.set_yticks(range(len(item.rows)), [_plain(shortened(name, margin - 10.0)) for name in item.rows])


def _scale(axes: Axes, way: Way, wanted: Axis, length: float, own: bool) -> None:
    """Limits, scale and ticks of the axis "x" or "y" of this length [px]; the ticks only where it has its ``own``."""
    if wanted.log:
        axes.set(**{f"{way}scale": "log"})
    if wanted.limits is not None:
        axes.set(**{f"{way}lim": wanted.limits})
    if wanted.ticks is not None and own:
        axis, ticks = axes.xaxis if way == "x" else axes.yaxis, fitting(wanted, length, way)
        axis.set_major_locator(FixedLocator([at for at, _ in ticks]))
        axis.set_major_formatter(FixedFormatter([_plain(text) for _, text in ticks]))
        axis.set_minor_locator(NullLocator())
    elif not wanted.log:
        axes.locator_params(axis=way, nbins=ticks_on(length, way))


def _handle(key: Key) -> Line2D | Patch:
    # matplotlib leaves out what begins with an underscore
    label = " " + _plain(key.label) if key.label.startswith("_") else _plain(key.label)
    if key.area:
        return Patch(color=key.colour, alpha=0.5, linewidth=0, label=label)
    if key.marker:
        return Line2D([], [], color=key.colour, linestyle="none", marker=_MARKERS[key.marker], markersize=6, label=label)
    return Line2D([], [], color=key.colour, linewidth=1.5, linestyle=_DASHES[key.dash], label=label)


def _plain(text: str) -> str:
    """A dollar is a dollar, not the begin of a formula."""
    return text.replace("$", r"\$")
