"""A figure as plain values: what is drawn, where, in which colour and unit. It knows no robot and no drawing library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np

from sysid_ros.pages.palette import INK
from sysid_ros.sample import FloatArray

Dash: TypeAlias = Literal["solid", "dashed", "dashdot", "dotted"]
Marker: TypeAlias = Literal["", "dot", "bar", "diamond"]
Way: TypeAlias = Literal["x", "y"]


@dataclass(frozen=True, eq=False, slots=True)
class Curve:
    """Points, joined where there is a width.

    Attributes:
        x, y: shape (N,); a NaN breaks the line. label: in the legend, "" for none. colour: "#RRGGBB".
        width: of the line, 0 for points alone [px]. marker, size: of each point, "" for none [px]. opacity: 0 to 1.
        step: constant about each point.
    """

    x: FloatArray
    y: FloatArray
    label: str = ""
    colour: str = INK
    width: float = 1.4
    dash: Dash = "solid"
    marker: Marker = ""
    size: float = 4.0
    opacity: float = 1.0
    step: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Band:
    """The area from ``low`` to ``high``, shape (N,) each; a NaN ends one part of it."""

    x: FloatArray
    low: FloatArray
    high: FloatArray
    label: str = ""
    colour: str = INK
    opacity: float = 0.2


@dataclass(frozen=True, eq=False, slots=True)
class Spans:
    """Stretches of one axis, ``start`` to ``end`` of shape (K,), over the whole of the other."""

    axis: Way
    start: FloatArray
    end: FloatArray
    label: str = ""
    colour: str = INK
    opacity: float = 0.13


@dataclass(frozen=True, slots=True)
class Mark:
    """A line across the panel at one value of an axis; ``text`` stands beside it at the top, where there is room."""

    axis: Way
    at: float
    text: str = ""
    label: str = ""
    colour: str = INK
    width: float = 0.9
    dash: Dash = "solid"


@dataclass(frozen=True, eq=False, slots=True)
class Cells:
    """A table of coloured cells: values of shape (rows, columns) from 0 to ``most``, with the text of each."""

    values: FloatArray
    texts: tuple[tuple[str, ...], ...]
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    most: float


Item: TypeAlias = Curve | Band | Spans | Mark | Cells


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis.

    Attributes:
        label: with its unit. limits: of the values, None for what the curves need. log: logarithmic.
        ticks: (value, text) each, None for usual ones, () for none. clock: it is the time at which the page shows the robot, so
            that its cursor moves along it.
    """

    label: str = ""
    limits: tuple[float, float] | None = None
    log: bool = False
    ticks: tuple[tuple[float, str], ...] | None = None
    clock: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Panel:
    """Items over common axes.

    Attributes:
        items: in the order in which they are drawn. title: above, at the left, with the unit of y. note: above, at the right.
        height: [px]. within: text in the middle, where there is nothing to draw.
    """

    items: tuple[Item, ...]
    title: str = ""
    note: str = ""
    x: Axis = Axis()
    y: Axis = Axis()
    height: float = 130.0
    within: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class Stack:
    """Panels one below the other.

    Attributes:
        title, note: above them. shared: they have one x axis in common, labelled at the last.
        width: beside other stacks, in parts. least: narrower than this it does not stand beside another [px].
    """

    panels: tuple[Panel, ...]
    title: str = ""
    note: str = ""
    shared: bool = True
    width: float = 1.0
    least: float = 300.0


@dataclass(frozen=True, eq=False, slots=True)
class Figure:
    """Stacks side by side, in rows of at most ``columns``.

    Attributes:
        title, subtitle: above all. width: of a picture [px]. legends: whether each panel has its own legend.
    """

    stacks: tuple[Stack, ...]
    title: str = ""
    subtitle: str = ""
    columns: int = 1
    width: float = 1100.0
    legends: bool = False


@dataclass(frozen=True, slots=True)
class Key:
    """An entry of a legend: a line, a marker, or an area."""

    label: str
    colour: str
    dash: Dash = "solid"
    marker: Marker = ""
    area: bool = False


SEVERAL = "#777777"
"""Colour of a key that stands for items of different colours."""


def keys(panels: Sequence[Panel]) -> list[Key]:
    """The legend of panels: each label once, as its first item is drawn, lines before areas."""
    found: dict[str, Key] = {}
    for item in (i for panel in panels for i in panel.items if not isinstance(i, Cells) and i.label):
        first = found.get(item.label)
        if first is not None:
            found[item.label] = first if first.colour == item.colour else replace(first, colour=SEVERAL)
            continue
        dash: Dash = item.dash if isinstance(item, Curve | Mark) else "solid"
        marker: Marker = item.marker if isinstance(item, Curve) and not item.width else ""
        found[item.label] = Key(item.label, item.colour, dash, marker, isinstance(item, Band | Spans))
    return sorted(found.values(), key=lambda key: key.area)


def legends(figure: Figure) -> list[tuple[str, list[Key]]]:
    """Each panel's title with its legend, or "" with that of all."""
    panels = [panel for stack in figure.stacks for panel in stack.panels]
    groups = [(p.title, keys([p])) for p in panels] if figure.legends else [("", keys(panels))]
    return [(title, entries) for title, entries in groups if entries]


def evenly(count: int, most: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Indices of at most ``most`` of so many points, evenly."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp)) if count else np.zeros(0, np.intp)


def peaks(values: FloatArray, most: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Indices of at most ``most`` points that keep every peak: the least and the greatest of each stretch."""
    if values.size <= most:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, most // 2 + 1).astype(int)
    return np.unique([a + f(values[a:b]) for a, b in pairwise(edges) for f in (np.argmin, np.argmax)])


def with_gaps(longest: float, t: FloatArray, *values: FloatArray) -> tuple[FloatArray, ...]:
    """``t`` and the values with NaN where a step is longer than ``longest``, so that no line crosses a gap."""
    after = np.flatnonzero(np.diff(t) > longest) + 1
    return np.insert(t, after, t[after]), *(np.insert(v, after, np.nan) for v in values)


def without_gaps(t: FloatArray) -> float:
    """The longest step of evenly spaced times that is no gap yet."""
    return 3.0 * float(np.median(np.diff(t))) if t.size > 1 else 1.0
