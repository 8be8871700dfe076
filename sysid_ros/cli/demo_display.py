"""What the demo shows while it runs: a table in a terminal, a line a second elsewhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from sysid_ros.cli.demo_verdict import Comparison, compare
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.pages import TruthSegment
from sysid_ros.pages.payload_curves import event_text

_STYLE = {"ok": "green", "no_payload": "bright_black", "warming_up": "yellow", "not_excited": "cyan", "inconsistent": "bold red"}
_ROWS = ("mass", "com x", "com y", "com z", "Ixx", "Iyy", "Izz")
_UNITS = ("kg", "mm", "mm", "mm", "g m²", "g m²", "g m²")
_BAR = 40


@dataclass(frozen=True, slots=True)
class Picture:
    """All that is shown at one instant.

    Attributes:
        t, duration: time since the start of the motion, and its length [s]. start: stamp of the start [s].
        estimate: the last one. truth: what is carried now. events: that the estimator found.
    """

    t: float
    duration: float
    start: float
    estimate: PayloadEstimate
    truth: TruthSegment
    events: Sequence[PayloadEvent]


class Display:
    """Shows pictures within ``with``: redrawn in a terminal, else one line a second."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, refresh_per_second=8, transient=True) if console.is_terminal else None
        self._last_second = -math.inf
        self._told_events = 0

    def __enter__(self) -> Display:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._live is not None:
            self._live.stop()

    def wait(self, sentence: str) -> None:
        """Say what is waited for, in a terminal."""
        if self._live is not None:
            self._live.update(Text(f"\n  {sentence}", style="yellow"))

    def show(self, picture: Picture) -> None:
        """Draw it, or write its line when a second has passed."""
        if self._live is not None:
            self._live.update(panel(picture))
        elif math.floor(picture.t) > self._last_second:
            self._last_second = math.floor(picture.t)
            new = _events(picture)[self._told_events :]
            self._told_events += len(new)
            self._console.print("; found: ".join([line(picture), *new]), highlight=False, soft_wrap=True)


def panel(picture: Picture) -> RenderableType:
    """The picture for a terminal."""
    done = min(1.0, max(0.0, picture.t / picture.duration))
    filled = round(_BAR * done)
    status = picture.estimate.status
    return Group(
        Text.assemble(
            ("\n  " + "━" * filled, "green"),
            ("━" * (_BAR - filled), "bright_black"),
            f"  {picture.t:4.1f} of {picture.duration:g} s",
        ),
        Text(f"  truth:    {_truth_text(picture)}"),
        Text.assemble(
            "  status:   ", (status, _STYLE.get(status, "magenta")), f"  {picture.estimate.reason}", overflow="ellipsis"
        ),
        comparison_table(compare(picture.estimate, picture.truth)),
        Text("  events found by the estimator:  " + ("; ".join(_events(picture)[-3:]) or "none yet")),
    )


def comparison_table(rows: Sequence[Comparison], title: str | None = None) -> Table:
    """Truth, estimate, its 95 % interval and the error; rows that say nothing yet stay, so that the table keeps its height."""
    table = Table(title=title, title_justify="left")
    table.add_column("")
    for name in ("truth", "estimate", "95 %", "error"):
        table.add_column(name, justify="right", min_width=9)
    table.add_column("inside", justify="center")
    table.add_column("unit")
    known = {row.name: row for row in rows}
    for name, unit in zip(_ROWS, _UNITS, strict=True):
        row = known.get(name)
        if row is None:
            table.add_row(name, "–", "–", "–", "–", "", unit, style="bright_black")
            continue
        digits = 3 if unit == "kg" else 2
        table.add_row(
            name,
            f"{row.truth:.{digits}f}",
            Text(f"{row.estimate:.{digits}f}", style="bold"),
            f"± {row.half:.{digits}f}",
            f"{row.error:+.{digits}f}",
            Text("yes", style="green") if row.inside else Text("no", style="yellow"),
            unit,
        )
    return table


def line(picture: Picture) -> str:
    """The picture as one line."""
    rows = compare(picture.estimate, picture.truth)
    mass = rows[0]
    text = f"{picture.t:5.1f} s  {picture.estimate.status:<13}"
    text += f"mass {mass.estimate:6.3f} ± {mass.half:.3f} kg (truth {mass.truth:.3f}, error {mass.error:+.3f})"
    if len(rows) > 1:
        found, true = (", ".join(f"{x:.1f}" for x in xs) for xs in zip(*((r.estimate, r.truth) for r in rows[1:4]), strict=True))
        text += f"  com [{found}] mm (truth [{true}])"
    return text


def _truth_text(picture: Picture) -> str:
    since = picture.t - (picture.truth.start - picture.start)
    if picture.truth.mass:
        return f"carries {picture.truth.mass:g} kg, picked up {since:.1f} s ago"
    return "carries nothing" + (f", dropped {since:.1f} s ago" if picture.truth.start - picture.start > 0.5 else "")


def _events(picture: Picture) -> list[str]:
    return [f"{event_text(e)} at {e.t - picture.start:.2f} s" for e in picture.events]
