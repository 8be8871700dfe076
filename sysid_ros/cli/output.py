"""What commands show: messages on stderr, progress where a person watches, tables on stdout, JSON in files."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


class Advance(Protocol):
    """Moves a progress bar on by so many steps."""

    def __call__(self, steps: int) -> None: ...


def report() -> Console:
    """Where tables are printed: as wide as the terminal, and wide enough for every column where there is none."""
    return Console() if sys.stdout.isatty() else Console(width=120)


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


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a document for machines."""
    path.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n")


class ManyValues(click.Command):
    """A command whose repeatable options take several values at once: ``--validate A B`` is ``--validate A --validate B``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the option's name before each of its values."""
        repeatable = {name for p in self.params if isinstance(p, click.Option) and p.multiple for name in p.opts}
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
