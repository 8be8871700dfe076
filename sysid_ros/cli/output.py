"""What commands show: messages on stderr, progress where a person watches, tables on stdout, JSON in files."""

from __future__ import annotations

import json
import shlex
import sys
import threading
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import click
from rich import box
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from sysid_ros.exceptions import SettingsError


class Advance(Protocol):
    """Moves a progress bar on by so many steps."""

    def __call__(self, steps: int) -> None: ...


def report(width: int = 120) -> Console:
    """Where tables are printed: as wide as the terminal, and wide enough for every column where there is none."""
    return Console(width=None if sys.stdout.isatty() else width, highlight=False)


def table(title: str, *columns: str, words: Collection[str] = ()) -> Table:
    """A table of numbers: the first column holds names; those of ``words`` are text, which may wrap."""
    out = Table(title=title, title_justify="left", box=box.SIMPLE)
    for i, column in enumerate(columns):
        text = column in words
        out.add_column(column, justify="left" if text or i == 0 else "right", no_wrap=not text)
    return out


def require_folders(**paths: Path | None) -> None:
    """Check, before the work and not after it, that what is asked for can be written; each path by its option's name.

    Raises:
        SettingsError: the folder of a path does not exist.
    """
    for name, path in paths.items():
        if path is not None and not path.parent.is_dir():
            option = "--" + name.replace("_", "-")
            raise SettingsError(f"{option} is '{path}', but the folder '{path.parent}' does not exist. Create it first.")


def require_new(paths: Iterable[Path | None], force: bool) -> None:
    """Check, before the work, that no result of before is overwritten.

    Raises:
        SettingsError: a folder does not exist, or a file does and ``force`` is not given.
    """
    for path in paths:
        if path is None:
            continue
        if not path.parent.is_dir():
            raise SettingsError(f"The folder '{path.parent}' of '{path.name}' does not exist. Create it first.")
        if path.exists() and not force:
            raise SettingsError(f"'{path}' exists already and is not overwritten. Choose another name, or give --force.")


def command_line() -> str:
    """The command that runs, as it was given, for the provenance of what it writes."""
    return shlex.join(["sysid", *(click.get_current_context().find_root().obj or [])])


def note(sentence: str) -> None:
    """A message on stderr."""
    click.echo(sentence, err=True)


def warn(sentence: str) -> None:
    """A warning on stderr."""
    click.echo(f"Warning: {sentence}", err=True)


@contextmanager
def progress_bar(what: str, total: int) -> Iterator[Advance]:
    """A bar on stderr, or nothing where stderr is no terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty(), transient=True) as progress:
        task = progress.add_task(what, total=total)
        yield lambda steps: progress.advance(task, steps)


@contextmanager
def said_if_slow(what: str, after: float = 1.5) -> Iterator[None]:
    """Say what is being done, and for how long it has been, where it takes longer than ``after`` [s]: a line on stderr that goes
    where a person watches, and stays in a log."""
    done = threading.Event()

    def say() -> None:
        if done.wait(after):
            return
        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
        if not sys.stderr.isatty():
            note(f"{what}.")
            return
        with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
            progress.add_task(what, total=None)
            done.wait()

    said = threading.Thread(target=say, daemon=True)
    said.start()
    try:
        yield
    finally:
        done.set()
        said.join()


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a document for machines."""
    path.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n")


class ManyValues(click.Command):
    """A command whose repeatable options take several values at once: ``--validate A B`` is ``--validate A --validate B``.

    Args:
        one_each: options that take one value each time, for which an argument may follow them.
    """

    def __init__(self, *args: Any, one_each: Sequence[str] = (), **more: Any) -> None:
        super().__init__(*args, **more)
        self._one_each = set(one_each)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the option's name before each of its values."""
        several = [p for p in self.params if isinstance(p, click.Option) and p.multiple]
        repeatable = {name for p in several for name in p.opts} - self._one_each
        expanded: list[str] = []
        option = ""
        for argument in args:
            if argument.startswith("-") and argument != "-":
                option = argument if argument in repeatable else ""
                if not option:
                    expanded.append(argument)
                continue
            expanded += [option, argument] if option else [argument]
        if args and args[-1] in repeatable:
            expanded.append(args[-1])
        return super().parse_args(ctx, expanded)
