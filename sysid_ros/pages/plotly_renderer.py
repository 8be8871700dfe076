"""Describes a figure to plotly, as plain values for the JSON that a page holds: it draws them when it is opened."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import numpy as np

from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Band, Cells, Curve, Figure, Mark, Spans
from sysid_ros.pages.layout import HEAD, NOTE, ROW, Place, fitting, mark_texts, places, shortened, ticks_on
from sysid_ros.sample import FloatArray

WIDTHS = (320.0, 680.0, 1080.0)
"""A page takes the layout of the widest of these that it has room for [px]."""
_DASHES = {"solid": "solid", "dashed": "dash", "dashdot": "dashdot", "dotted": "dot"}
_MARKERS = {"dot": "circle", "bar": "line-ns-open", "diamond": "diamond"}
_FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif'
_NONE = "rgba(0,0,0,0)"


def specification(figure: Figure) -> dict[str, Any]:
    """``arrays``; ``data``, traces whose x and y are indices of them; ``layout`` and, for each of ``WIDTHS``, more of it;
    ``clocks``, the x and y axes of panels over the page's time."""
    arrays, nothing = _Arrays(), np.zeros(0)
    data: list[dict[str, Any]] = []
    shapes: list[dict[str, Any]] = []
    placed, _ = places(figure, WIDTHS[-1])
    for k, place in enumerate(placed, start=1):
        own = {"xaxis": _id("x", k), "yaxis": _id("y", k)}
        for item in place.panel.items:
            if isinstance(item, Spans | Mark):
                shapes.append(_shape(item) | _over(k, item.axis))
            else:
                data.append(_trace(item, arrays.index) | own)
        if not any(isinstance(item, Curve | Band | Cells) for item in place.panel.items):
            # plotly makes no axes where there is no trace
            data.append({"type": "scatter", "x": arrays.index(nothing), "y": arrays.index(nothing)} | own)
    shared = all(stack.shared for stack in figure.stacks)
    layout = {
        "shapes": shapes,
        "showlegend": False,
        "hovermode": "x unified" if shared else "closest",
        "paper_bgcolor": _NONE,
        "plot_bgcolor": _NONE,
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "font": {"size": 11, "family": _FONT, "color": palette.INK},
    }
    clocks = [[_key("x", k), _key("y", k)] for k, place in enumerate(placed, start=1) if place.panel.x.clock]
    layouts = [_layout(figure, w) for w in WIDTHS]
    return {"arrays": arrays.values, "data": data, "layout": layout, "layouts": layouts, "clocks": clocks}


class _Arrays:
    """Numbers of six digits, each array once, however many traces take it."""

    def __init__(self) -> None:
        self.values: list[list[float | None]] = []
        self._known: dict[int, tuple[FloatArray, int]] = {}

    def index(self, array: FloatArray) -> int:
        """Of the array in ``values``; NaN becomes null."""
        if id(array) not in self._known:
            numbers = np.asarray(array, dtype=float).tolist()
            self.values.append([float(f"{x:.6g}") if np.isfinite(x) else None for x in numbers])
            self._known[id(array)] = (array, len(self.values) - 1)
        return self._known[id(array)][1]


def _trace(item: Curve | Band | Cells, index: Callable[[FloatArray], int]) -> dict[str, Any]:
    match item:
        case Curve():
            line = {"color": item.colour, "width": item.width, "dash": _DASHES[item.dash]}
            line |= {"shape": "hvh"} if item.step else {}
            marker = {"symbol": _MARKERS.get(item.marker, "circle"), "size": item.size, "color": item.colour}
            parts = ["lines"] * bool(item.width) + ["markers"] * bool(item.marker)
            drawn = {"x": index(item.x), "y": index(item.y), "mode": "+".join(parts), "line": line, "marker": marker}
            cloud = {"hoverinfo": "skip"} if item.opacity < 1.0 else {"hovertemplate": "%{y:.4g}"}
            return _named(item) | drawn | cloud
        case Band():
            x, y = _outline(item)
            area = {"mode": "lines", "line": {"width": 0}, "fill": "toself", "fillcolor": item.colour, "hoverinfo": "skip"}
            return _named(item) | {"x": index(x), "y": index(y)} | area
        case Cells():
            texts = [[_text(text) for text in row] for row in item.texts]
            names = {"x": [_text(name) for name in item.columns], "y": [*range(len(item.rows))]}
            colours = {"zmin": 0.0, "zmax": item.most, "colorscale": [*enumerate(palette.CELLS)], "showscale": False}
            shown = {"text": texts, "texttemplate": "%{text}", "hoverinfo": "x+y+text"}
            return {"type": "heatmap", "z": item.values.tolist()} | names | colours | shown


def _named(item: Curve | Band) -> dict[str, Any]:
    return {"type": "scatter", "name": _text(item.label), "meta": item.label, "opacity": item.opacity}


def _outline(band: Band) -> tuple[FloatArray, FloatArray]:
    """The edge of each part, one after the other: plotly fills across gaps, but not across the end of a polygon."""
    there = np.isfinite(band.low) & np.isfinite(band.high)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    xs: list[FloatArray] = [np.zeros(0)]
    ys: list[FloatArray] = [np.zeros(0)]
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        xs += [band.x[a:b], band.x[a:b][::-1], np.array([np.nan])]
        ys += [band.high[a:b], band.low[a:b][::-1], np.array([np.nan])]
    return np.concatenate(xs), np.concatenate(ys)


def _shape(item: Spans | Mark) -> dict[str, Any]:
    """All the stretches of one kind as one path, or a line."""
    if isinstance(item, Mark):
        line = {"color": item.colour, "width": item.width, "dash": _DASHES[item.dash]}
        return {"path": _path(item.axis, [(item.at, item.at)]), "line": line, "name": item.label}
    path = _path(item.axis, list(zip(item.start.tolist(), item.end.tolist(), strict=True)))
    fill = {"fillcolor": item.colour, "opacity": item.opacity, "line": {"width": 0}, "layer": "below"}
    return {"path": path, "name": item.label} | fill


def _path(axis: str, stretches: list[tuple[float, float]]) -> str:
    corners = "M{a:.6g},0L{a:.6g},1L{b:.6g},1L{b:.6g},0Z" if axis == "x" else "M0,{a:.6g}L1,{a:.6g}L1,{b:.6g}L0,{b:.6g}Z"
    return "".join(corners.format(a=a, b=b) for a, b in stretches) or "M0,0Z"


def _over(k: int, axis: str) -> dict[str, str]:
    """The panel that a shape lies in, over the whole of the other axis."""
    x, y = _id("x", k), _id("y", k)
    return {"type": "path", "xref": x if axis == "x" else f"{x} domain", "yref": y if axis == "y" else f"{y} domain"}


def _layout(figure: Figure, width: float) -> dict[str, Any]:
    """Axes and words at a width of the page."""
    placed, height = places(figure, width)
    firsts: dict[int, int] = {}
    axes: dict[str, Any] = {}
    words: list[dict[str, Any]] = []
    for k, place in enumerate(placed, start=1):
        first = firsts.setdefault(place.stack, k)
        x = _axis(place.panel.x, "x", place.width, place.axis) | {
            "anchor": _id("y", k),
            "domain": _domain(place.left, place.width, width),
        }
        y = _axis(place.panel.y, "y", place.height, True) | {"anchor": _id("x", k)}
        y |= {"domain": _domain(height - place.top - place.height, place.height, height)}
        if figure.stacks[place.stack].shared and k != first:
            x["matches"] = _id("x", first)
        for cells in (item for item in place.panel.items if isinstance(item, Cells)):
            rows = [_text(shortened(name, place.margin - 10.0)) for name in cells.rows]
            y |= {"autorange": "reversed", "tickvals": [*range(len(rows))], "ticktext": rows}
        axes |= {_key("x", k): x, _key("y", k): y}
        words += _words(place, k)
    # a finger that drags scrolls the page of a telephone
    drag = {"dragmode": False} if width < WIDTHS[1] else {"dragmode": "zoom"}
    return {"least": width, "layout": {"height": height, "annotations": words} | axes | drag}


def _axis(axis: Axis, way: str, length: float, labelled: bool) -> dict[str, Any]:
    style: dict[str, Any] = {"showgrid": axis.ticks != (), "gridcolor": palette.GRID, "zeroline": False}
    style |= {
        "nticks": ticks_on(length, way),
        "showticklabels": labelled and axis.ticks != (),
        "type": "log" if axis.log else None,
        "tickangle": 0,
    }
    if axis.limits is not None:
        style["range"] = [float(x) for x in (np.log10(axis.limits) if axis.log else axis.limits)]
    if axis.ticks:
        ticks = fitting(axis, length, way)
        style |= {"tickvals": [at for at, _ in ticks], "ticktext": [_text(text) for _, text in ticks]}
    elif axis.log:
        style |= {"exponentformat": "power", "dtick": 1}
    if labelled and axis.label:
        style["title"] = {"text": _text(axis.label), "standoff": 2, "font": {"size": 11}}
    return style


def _words(place: Place, k: int) -> list[dict[str, Any]]:
    """Title, note, heading and the texts of marks."""
    corner = {"xref": f"{_id('x', k)} domain", "yref": f"{_id('y', k)} domain", "showarrow": False, "y": 1.0, "yanchor": "bottom"}
    left, right = {"x": 0.0, "xanchor": "left"}, {"x": 1.0, "xanchor": "right"}
    out = []
    if place.title:
        out.append(corner | left | {"text": _text(place.title), "font": {"size": 12}})
    if place.panel.note:
        out.append(corner | right | {"text": _text(place.panel.note)})
    above = HEAD if place.panel.title or place.panel.note else 0.0
    for i, line in enumerate(reversed(place.heading)):
        bold = i == len(place.heading) - 1
        font = {"size": 13 if bold else 11}
        text = f"<b>{_text(line)}</b>" if bold else _text(line)
        out.append(corner | left | {"text": text, "font": font, "yshift": above + i * NOTE})
    if place.panel.within:
        out.append(corner | {"text": _text(place.panel.within), "x": 0.5, "y": 0.5, "yanchor": "middle"})
    for mark, row, before in mark_texts(place):
        side = {"xanchor": "right", "xshift": -1} if before else {"xanchor": "left", "xshift": 1}
        at = {
            "xref": _id("x", k),
            "x": mark.at,
            "yanchor": "middle",
            "yshift": -(row + 0.5) * ROW,
            "font": {"color": mark.colour},
        }
        out.append(corner | at | side | {"text": _text(mark.text)})
    return out


def _domain(start: float, length: float, whole: float) -> list[float]:
    return [max(0.0, start / whole), min(1.0, (start + length) / whole)]


def _id(way: str, k: int) -> str:
    return way if k == 1 else f"{way}{k}"


def _key(way: str, k: int) -> str:
    return f"{way}axis{k if k > 1 else ''}"


def _text(text: str) -> str:
    """Plotly takes tags for what they are, wherever it writes."""
    return escape(text, quote=False)
