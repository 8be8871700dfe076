"""Where the panels of a figure stand at a given width, the same for every drawing library; lengths in px from the top left."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from sysid_ros.pages.figure import Axis, Cells, Figure, Mark, Panel, Stack, keys

LEFT, RIGHT = 46.0, 10.0
HEAD, NOTE, TITLE, TICKS, LABEL, GAP = 20.0, 15.0, 20.0, 17.0, 15.0, 9.0
LETTER = 6.0
"""Width of a letter at the size of what stands in a figure."""
ROW = 15.0
_MOST_ROWS = 3


@dataclass(frozen=True, eq=False, slots=True)
class Place:
    """A panel between its axes.

    Attributes:
        stack: index of its stack. left, top, width, height: between the axes. margin: at the left, for the numbers of y.
        title: of the panel, "" where its neighbour at the left says the same. heading: the stack's title and lines of its note,
            at its first panel. axis: whether the x axis has its numbers here.
    """

    panel: Panel
    stack: int
    left: float
    top: float
    width: float
    height: float
    margin: float
    title: str
    heading: tuple[str, ...]
    axis: bool


def places(figure: Figure, width: float) -> tuple[list[Place], float]:
    """All panels in the order of the stacks, and the height of all."""
    found: list[Place] = []
    top = 0.0
    numbered = list(enumerate(figure.stacks))
    for row in _rows(numbered, figure.columns, width):
        parts = [width * stack.width / sum(s.width for _, s in row) for _, stack in row]
        headings = [_heading(stack, part) for (_, stack), part in zip(row, parts, strict=True)]
        lines = max(len(heading) for heading in headings)
        start = top + (HEAD + (lines - 1) * NOTE if lines else 0.0)
        height = max(sum(_around(figure, s, i) + p.height for i, p in enumerate(s.panels)) for _, s in row)
        left = 0.0
        said: Sequence[str] = ()
        for (index, stack), part, heading in zip(row, parts, headings, strict=True):
            found += _stack(figure, index, stack, (left, start, part, height), heading, said)
            said = [panel.title for panel in stack.panels]
            left += part
        top = start + height
    return found, top


def mark_texts(place: Place) -> Iterator[tuple[Mark, int, bool]]:
    """The texts beside marks for which there is room: the mark, its row from the top, and whether it stands at the left of it."""
    marks = [m for m in place.panel.items if isinstance(m, Mark) and m.text and m.axis == "x"]
    low, high = place.panel.x.limits or (min((m.at for m in marks), default=0.0), max((m.at for m in marks), default=1.0) + 1e-9)
    taken = [-float("inf")] * max(1, min(_MOST_ROWS, int(0.75 * place.height / ROW)))
    for mark in sorted(marks, key=lambda m: m.at):
        at, long = place.width * (mark.at - low) / (high - low), LETTER * len(mark.text) + 6.0
        before = at + long > place.width
        begin = at - long if before else at
        row = next((r for r, end in enumerate(taken) if end <= begin), None)
        if row is not None:
            taken[row] = begin + long
            yield mark, row, before


def fitting(axis: Axis, length: float, way: str) -> tuple[tuple[float, str], ...]:
    """As many of the ticks of an axis "x" or "y" of this length as have room, evenly."""
    ticks = axis.ticks or ()
    room = LETTER * max((len(text) for _, text in ticks), default=0) + 8.0 if way == "x" else 13.0
    return ticks[:: max(1, -int(-len(ticks) * room // length))]


def shortened(text: str, room: float) -> str:
    """The end of a text that is too long, in which names differ most."""
    most = max(4, int(room / LETTER))
    return text if len(text) <= most else "…" + text[1 - most :]


def ticks_on(length: float, way: str) -> int:
    """How many numbers an axis "x" or "y" of this length has room for."""
    return max(2, int(length // (65.0 if way == "x" else 34.0))) + 1


def _rows(stacks: Sequence[tuple[int, Stack]], columns: int, width: float) -> Iterator[list[tuple[int, Stack]]]:
    """As many stacks beside each other as have room, all rows alike."""
    fit = max(1, min(columns, int(width // max(s.least for _, s in stacks)))) if stacks else 1
    rows = -(-len(stacks) // fit)
    each = -(-len(stacks) // max(rows, 1))
    for a, b in pairwise([*range(0, len(stacks), each or 1), len(stacks)]):
        yield list(stacks[a:b])


def _heading(stack: Stack, width: float) -> tuple[str, ...]:
    lines = textwrap.wrap(stack.note, max(10, int((width - LEFT) / LETTER))) if stack.note else []
    return (stack.title, *lines) if stack.title or lines else ()


def _has_axis(stack: Stack, index: int) -> bool:
    return not stack.shared or index == len(stack.panels) - 1


def _below(stack: Stack, index: int) -> float:
    axis = stack.panels[index].x
    if not _has_axis(stack, index):
        return GAP
    return GAP + (TICKS if axis.ticks != () else 0.0) + (LABEL if axis.label else 0.0)


def _above(figure: Figure, panel: Panel) -> float:
    return TITLE if panel.title or panel.note or (figure.legends and keys([panel])) else 0.0


def _around(figure: Figure, stack: Stack, index: int) -> float:
    return _above(figure, stack.panels[index]) + _below(stack, index)


def _margin(stack: Stack, width: float) -> float:
    """Room at the left for the longest word of an axis, where that leaves enough."""
    words = [text for p in stack.panels for _, text in p.y.ticks or ()]
    words += [name for p in stack.panels for item in p.items if isinstance(item, Cells) for name in item.rows]
    return min(max([LEFT, *(LETTER * len(word) + 12.0 for word in words)]), max(LEFT, 0.4 * width))


def _stack(
    figure: Figure,
    index: int,
    stack: Stack,
    box: tuple[float, float, float, float],
    heading: tuple[str, ...],
    said: Sequence[str],
) -> Iterator[Place]:
    left, top, width, height = box
    margin = _margin(stack, width)
    stretch = (height - sum(_around(figure, stack, i) for i in range(len(stack.panels)))) / sum(p.height for p in stack.panels)
    for i, panel in enumerate(stack.panels):
        top += _above(figure, panel)
        title = "" if i < len(said) and said[i] == panel.title else panel.title
        tall = stretch * panel.height
        inner = (left + margin, top, width - margin - RIGHT, tall, margin)
        yield Place(panel, index, *inner, title, () if i else heading, _has_axis(stack, i))
        top += tall + _below(stack, i)
