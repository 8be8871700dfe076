"""What the sub-commands of ``sysid simulate`` share: PyBullet, checks of the outputs, messages that name options."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TypeVar

from rich.table import Table

from sysid_ros.cli.output import check_outputs, report, write_json
from sysid_ros.cli.progress import progress_bar
from sysid_ros.exceptions import SettingsError, SysidError
from sysid_ros.files import check_bag, check_file, whole_folder
from sysid_ros.sources import BagRecorder

try:
    from sysid_ros.simulation.arm_record import START_TIME, truth_path, write_truth
except ModuleNotFoundError as missing:
    if not (missing.name or "").startswith("pybullet"):
        raise
    raise SysidError(
        "PyBullet is not installed; the simulation needs it. Install it with: pip install 'sysid_ros[sim]'"
    ) from missing

Rows = list[tuple[str, str]]
Record = TypeVar("Record")

_OPTION_OF = {"pick_time": "--pick", "drop_time": "--drop", "hoist_time": "--hoist", "shift_time": "--shift"}


def prepare(bag: Path, json_file: Path | None, force: bool) -> None:
    """Refuse outputs that exist already or can't be written.

    Raises:
        OutputError: the bag, the truth beside it or the summary is there already, or can't be written.
    """
    check_bag(bag, force, "--bag")
    check_file(truth_path(bag), force, "--bag")
    check_outputs(force, json=json_file)


@contextmanager
def recorder_of(bag: Path, storage: str, truth: Mapping[str, Any]) -> Iterator[BagRecorder]:
    """A recorder of the bag; bag and truth are there when the block is left, and neither when that is by an exception."""
    with whole_folder(bag, replace=True) as folder:
        with BagRecorder(folder, storage) as recorder:
            yield recorder
        write_truth(dict(truth), truth_path(bag))


def named_option(error: SettingsError, options: Collection[str]) -> SettingsError:
    """The error with the names of settings turned into those of their options."""
    text = str(error)
    for field in sorted(options, key=len, reverse=True):
        text = text.replace(field, _OPTION_OF.get(field, "--" + field.replace("_", "-"))) if "_" in field else text
    field = text.partition(" ")[0]
    return SettingsError(f"--{text}" if field in options else text)


class Scenario(Protocol):
    """What the options of a simulation ask for."""

    @property
    def duration(self) -> float: ...

    @property
    def rate(self) -> int: ...


Chosen = TypeVar("Chosen", bound=Scenario)


def simulated(
    scenario: Callable[..., Chosen],
    simulate: Callable[[Chosen, Callable[[int], None], float], Record],
    options: Mapping[str, Any],
) -> Record:
    """The recording that the options ask for, with a progress bar; messages about a setting name its option.

    Raises:
        SettingsError: an option is out of range, or the bag would never end.
    """
    try:
        chosen = scenario(**options)
        if math.isinf(chosen.duration):
            raise SettingsError("duration is inf; a bag must end. Give a number of seconds.")
        with progress_bar("Simulating", round(chosen.duration * chosen.rate)) as advance:
            return simulate(chosen, advance, START_TIME)
    except SettingsError as error:
        raise named_option(error, options) from None


def parameter_rows(effect: Mapping[str, Any]) -> Rows:
    """Parameters of an effect that is hidden."""
    rows: Rows = []
    for p in effect["parameters"]:
        numbers = p["value"] if isinstance(p["value"], list) else [p["value"]]
        text = ", ".join(x if isinstance(x, str) else f"{x:.4g}" for x in numbers)
        rows.append(("", f"{p['name']} = {text} {p['unit']}" + (f"  [{p['joint']}]" if p["joint"] else "")))
    return rows


def payload_rows(truth: Mapping[str, Any]) -> Rows:
    """What was carried, and when it was picked up and dropped."""
    payload = truth["payload"]
    if payload is None:
        return [("payload", "none")]
    com = ", ".join(f"{x:g}" for x in payload["com"])
    rows = [("payload", f"{payload['mass']:g} kg at [{com}] m in {truth['frame']}")]
    return rows + [(e["kind"], f"at {e['t'] - truth['start_time']:.3f} s (stamp {e['t']:.3f})") for e in truth["events"]]


def conclude(
    bag: Path, json_file: Path | None, messages: int, elapsed: float, truth: Mapping[str, Any], rows: Sequence[tuple[str, str]]
) -> None:
    """Write the summary, and show it.

    Args:
        elapsed: time that it took [s]. rows: of the table, after those that all simulations have.
    """
    truth_file = truth_path(bag)
    factor = truth["duration"] / elapsed
    files = {"bag": str(bag), "truth_file": str(truth_file)}
    if json_file is not None:
        write_json(json_file, {**files, "messages": messages, "realtime_factor": factor, "truth": truth})
    out = Table(title=f"Simulated {truth['robot']}", show_header=False)
    out.add_column(style="bold")
    out.add_column()
    sent, speed = f"{messages} at {truth['rate']} Hz, {truth['duration']:g} s", f"{factor:.1f} times real time"
    for name, text in (("bag", str(bag)), ("truth", str(truth_file)), ("messages", sent), ("speed", speed), *rows):
        out.add_row(name, text, style=None if name else "dim")
    report().print(out)
