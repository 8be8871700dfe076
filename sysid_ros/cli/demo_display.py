"""What the demo shows while it runs, the comparison with the truth in it, and what it asks of the estimate before the drop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.pages import TruthSegment
from sysid_ros.pages.payload_curves import event_text, inertia_diagonal_jacobian
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray

MASS_PART = 0.05
COM_ERROR = 0.01
EVENT_DELAY = 0.5
_JOINT_REGION = 18.47
"""99.9 % quantile of chi-squared with 4 degrees of freedom: a right estimator fails one demo in a thousand by it."""
_QUANTILE = 1.96

CRITERION = (
    f"Before the drop the status is ok, the mass is within {100 * MASS_PART:.0f} % and the centre of mass within "
    f"{1e3 * COM_ERROR:.0f} mm of the truth, the truth of both lies in the 99.9 % region of the stated covariance, and "
    f"pick and drop were found, dated within {EVENT_DELAY} s."
)


@dataclass(frozen=True, slots=True)
class Comparison:
    """One quantity against its truth, in the unit of ``unit``; ``half`` is half of the 95 % interval."""

    name: str
    unit: str
    truth: float
    estimate: float
    half: float

    @property
    def error(self) -> float:
        return self.estimate - self.truth

    @property
    def inside(self) -> bool:
        """The truth lies in the 95 % interval."""
        return abs(self.error) <= self.half


def compare(estimate: PayloadEstimate, truth: TruthSegment) -> list[Comparison]:
    """Mass, and where the arm carries something also centre of mass and the inertia's diagonal."""
    rows = [Comparison("mass", "kg", truth.mass, estimate.mass, _QUANTILE * estimate.mass_std)]
    if truth.mass == 0.0 or estimate.mass <= 3.0 * estimate.mass_std:
        return rows
    jacobian = inertia_diagonal_jacobian(estimate.theta)
    inertia_std = np.sqrt(np.einsum("ij,jk,ik->i", jacobian, estimate.covariance, jacobian))
    found, true = np.diag(estimate.inertia_com), np.diag(truth.inertia_com)
    for i, axis in enumerate("xyz"):
        rows.append(_scaled(f"com {axis}", "mm", truth.com[i], estimate.com[i], estimate.com_std[i]))
    for i, axis in enumerate("xyz"):
        rows.append(_scaled(f"I{axis}{axis}", "g m²", true[i], found[i], inertia_std[i]))
    return rows


def objections(estimate: PayloadEstimate | None, truth: TruthSegment, events: Sequence[PayloadEvent]) -> list[str]:
    """What speaks against the estimate by :data:`CRITERION`, one sentence each; empty where nothing does.

    Args:
        estimate: the last one before the drop. truth: what was carried then, from pick to drop.
        events: that the estimator found.
    """
    if estimate is None:
        return ["There is no estimate between pick and drop."]
    against = []
    if estimate.status != "ok":
        against.append(f"The status before the drop is {estimate.status}, not ok. {estimate.reason}".strip())
    error = estimate.mass - truth.mass
    if abs(error) > MASS_PART * truth.mass:
        against.append(f"The mass is wrong by {error:+.3f} kg, {100 * error / truth.mass:+.1f} %.")
    com_error = float(np.abs(estimate.com - truth.com).max())
    if not com_error <= COM_ERROR:
        against.append(f"The centre of mass is wrong by {1e3 * com_error:.1f} mm.")
    distance = _distance(estimate, truth)
    if not distance <= _JOINT_REGION:
        against.append(
            f"The stated covariance is too small: the truth of mass and centre is {distance:.0f} away by it; "
            f"{_JOINT_REGION} is allowed."
        )
    for kind, when in (("pick", truth.start), ("drop", truth.end)):
        if not any(e.kind == kind and abs(e.t - when) <= EVENT_DELAY for e in events):
            against.append(f"The {kind} was not found within {EVENT_DELAY} s.")
    return against


def _distance(estimate: PayloadEstimate, truth: TruthSegment) -> float:
    """Squared distance of the true mass and first moments, in standard deviations of the estimate."""
    true: FloatArray = inertial_parameters.from_com(truth.mass, truth.com, truth.inertia_com)
    error = estimate.theta[:4] - true[:4]
    return float(error @ np.linalg.solve(estimate.covariance[:4, :4], error))


def _scaled(name: str, unit: str, truth: float, estimate: float, std: float) -> Comparison:
    return Comparison(name, unit, 1e3 * truth, 1e3 * estimate, 1e3 * _QUANTILE * std)


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
