"""What the sub-commands of ``sysid simulate`` share: checks of the outputs, the progress bar, messages that name options."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from sysid_ros.exceptions import BagError, SettingsError
from sysid_ros.simulation.recording import truth_path

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
