"""What the sub-commands of ``sysid simulate`` share: checks of the outputs, the progress bar, messages that name options."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol, TypeVar

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from sysid_ros.exceptions import BagError, SettingsError
from sysid_ros.simulation.bag_and_truth import START_TIME, truth_path, write_truth

Record = TypeVar("Record")

_OPTION_OF = {"pick_time": "--pick", "drop_time": "--drop", "hoist_time": "--hoist"}


def prepare(bag: Path, json_file: Path | None) -> None:
    """Refuse outputs that exist already or can't be written.

    Raises:
        BagError: the truth file exists, or the folder of ``--json`` does not.
    """
    truth_file = truth_path(bag)
    if truth_file.exists():
        raise BagError(f"'{truth_file}' exists already and is not overwritten. Choose another --bag, or remove it first.")
    if json_file is not None and not json_file.parent.is_dir():
        raise BagError(f"--json is '{json_file}', but the folder '{json_file.parent}' does not exist. Create it first.")


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
        with Bar(round(chosen.duration * chosen.rate)) as advance:
            return simulate(chosen, advance, START_TIME)
    except SettingsError as error:
        raise named_option(error, options) from None


def conclude(
    bag: Path, json_file: Path | None, messages: int, elapsed: float, truth: Mapping[str, Any], more: Iterable[tuple[str, str]]
) -> None:
    """Write truth and summary, and show them.

    Args:
        elapsed: time that it took [s]. more: rows of the table after the payload's.
    """
    truth_file = truth_path(bag)
    write_truth(dict(truth), truth_file)
    factor = truth["duration"] / elapsed
    if json_file is not None:
        summary = {
            "bag": str(bag),
            "truth_file": str(truth_file),
            "messages": messages,
            "realtime_factor": factor,
            "truth": truth,
        }
        json_file.write_text(json.dumps(summary, indent=2) + "\n")
    table = Table(title=f"Simulated {truth['robot']}", show_header=False)
    table.add_column(style="bold")
    table.add_column()
    table.add_row("bag", str(bag))
    table.add_row("truth", str(truth_file))
    table.add_row("messages", f"{messages} at {truth['rate']} Hz, {truth['duration']:g} s")
    table.add_row("speed", f"{factor:.1f} times real time")
    payload = truth["payload"]
    if payload is None:
        table.add_row("payload", "none")
    else:
        com = ", ".join(f"{x:g}" for x in payload["com"])
        table.add_row("payload", f"{payload['mass']:g} kg at [{com}] m in {truth['frame']}")
        for event in truth["events"]:
            table.add_row(event["kind"], f"at {event['t'] - truth['start_time']:.3f} s (stamp {event['t']:.3f})")
    for name, text in more:
        table.add_row(name, text)
    Console().print(table)


class Bar:
    """A progress bar on stderr, and none where stderr is not a terminal."""

    def __init__(self, count: int) -> None:
        self._progress = Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty())
        self._task = self._progress.add_task("Simulating", total=count)

    def __enter__(self) -> Callable[[int], None]:
        self._progress.start()
        return lambda new: self._progress.advance(self._task, new)

    def __exit__(self, *_: object) -> None:
        self._progress.stop()
