"""What ``sysid replay`` shows: what was carried, the state at the end, what happened; within 80 columns."""

from __future__ import annotations

import math

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sysid_ros.cli.output import report, table
from sysid_ros.online.carried import Carried
from sysid_ros.online.replay import Replay


def show_replay(result: Replay, name: str, console: Console | None = None) -> None:
    """Print the answer first, on stdout."""
    console = console or report()
    if result.payloads:
        console.print(_bodies(result, name))
        console.print(_inertias(result))
        for k, one in enumerate(result.payloads, 1):
            if one.estimate.status != "ok":
                console.print(f"Payload {k} can't be believed: {one.estimate.status}. {one.estimate.reason}")
    else:
        console.print(f"Nothing that was carried was found in {name}.")
    _at_the_end(result, console)
    for e in result.events:
        mass = "" if e.passes else f": {e.mass_before:.3f} -> {e.mass_after:.3f} kg"
        console.print(f"  {e.t - result.start:7.2f} s  {e.kind.replace('_', ' ')}{mass}")
    for sentence in result.notes:
        console.print(escape(sentence))
    console.print(
        f"{result.used} of {result.read} samples used, {result.duration:.1f} s in {result.seconds:.2f} s "
        f"({result.duration / result.seconds:.0f} times real time)",
    )


def _bodies(result: Replay, name: str) -> Table:
    frame = result.final.frame
    out = table(f"Carried in {name} (± 95 %; com in {frame})", "", "from", "to s", "mass kg", "com x mm", "y", "z")
    for k, one in enumerate(result.payloads, 1):
        e = one.estimate
        mass = f"{e.mass:.3f} ± {1.96 * e.mass_std:.3f}"
        com = [
            _within(1e3 * x, 1.96e3 * std, 1) if told else "-"
            for x, std, told in zip(e.com, e.com_std, e.observable[1:4], strict=True)
        ]
        out.add_row(str(k), f"{one.t0 - result.start:.2f}", f"{one.t1 - result.start:.2f}", mass, *com)
    return out


def _inertias(result: Replay) -> Table:
    out = table("Inertia about the centre of mass, kg m² (- not determined by this motion)", "", "Ixx", "Iyy", "Izz")
    for k, one in enumerate(result.payloads, 1):
        out.add_row(str(k), *(_moment(one, i, at) for i, at in ((4, 0), (6, 1), (9, 2))))
    return out


def _moment(one: Carried, i: int, at: int) -> str:
    if not one.estimate.observable[i]:
        return "-"
    return _within(float(one.estimate.inertia_com[at, at]), 1.96 * float(one.inertia_std[at, at]), 4)


def _within(value: float, band: float, digits: int) -> str:
    """A number with its interval; no number where the interval is wide beyond sense."""
    if not math.isfinite(value + band) or band >= 10.0 ** (4 - digits + (digits > 1)):
        return "-"
    return f"{value:.{digits}f} ± {band:.{digits}f}"


def _at_the_end(result: Replay, console: Console) -> None:
    final = result.final
    state = {"ok": f"{final.mass:.3f} ± {1.96 * final.mass_std:.3f} kg", "no_payload": "nothing is carried"}
    said = f"{state[result.status]} " if result.status in state else ""
    console.print(f"At the end: {said}(status {result.status}). {result.reason}".rstrip())
