"""What commands show: messages on stderr, tables on stdout, JSON in files; and what is checked of their outputs first."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import click
from rich import box
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from sysid_ros.exceptions import OutputError
from sysid_ros.files import check_file, is_stream, write_text

_BESIDE = 3
"""Blanks about a column and between it and the next."""
_WORDS = 24
"""Width of a column of words where there is no room for more."""


class _Terminal(Console):
    """Tables and messages; a reader that has gone is an error, which ends the command quietly."""

    def on_broken_pipe(self) -> None:
        """Called in place of the error."""
        raise BrokenPipeError

    def print(self, *objects: Any, **options: Any) -> None:
        """As of rich, with tables in as many parts as keep every number whole."""
        parts = [part for x in objects for part in (in_parts(x, self) if isinstance(x, Table) else [x])]
        super().print(*parts, **options)


def in_parts(whole: Table, console: Console) -> list[Table]:
    """A table as it is where it fits the console, else its columns below one another, each part beginning with the first."""
    widths = [_width(column, console) for column in whole.columns]
    groups: list[list[int]] = [[0]]
    for k in range(1, len(widths)):
        taken = sum(widths[i] + _BESIDE for i in (*groups[-1], k)) + 1
        if taken > console.width and len(groups[-1]) > 1:
            groups.append([0])
        groups[-1].append(k)
    if len(groups) == 1:
        return [whole]
    out = []
    for group in groups:
        part = Table(title=whole.title if group is groups[0] else None, title_justify=whole.title_justify, box=whole.box)
        for k in group:
            of = whole.columns[k]
            part.add_column(of.header, justify=of.justify, no_wrap=of.no_wrap)
        cells = zip(*(whole.columns[k].cells for k in group), strict=True)
        for row, texts in zip(whole.rows, cells, strict=True):
            part.add_row(*texts, style=row.style, end_section=row.end_section)
        out.append(part)
    return out


def _width(column: Column, console: Console) -> int:
    """Of a column whose texts are whole; of words, which may wrap, a dozen or two of letters."""
    texts = [x if isinstance(x, Text) else console.render_str(str(x)) for x in (column.header, *column.cells)]
    whole = max((line.cell_len for text in texts for line in text.split("\n")), default=0)
    return whole if column.no_wrap else min(whole, _WORDS)


def report(width: int = 120) -> Console:
    """Where tables are printed: as wide as the terminal, and wide enough for every column where there is none."""
    return _Terminal(width=None if sys.stdout.isatty() else width, highlight=False)


def table(title: str, *columns: str, words: Collection[str] = ()) -> Table:
    """A table of numbers: the first column holds names; those of ``words`` are text, which may wrap."""
    out = Table(title=title, title_justify="left", box=box.SIMPLE)
    for i, column in enumerate(columns):
        text = column in words
        out.add_column(column, justify="left" if text or i == 0 else "right", no_wrap=not text)
    return out


def check_outputs(force: bool, **paths: Path | Sequence[Path] | None) -> None:
    """Check, before the work and not after it, that each file that is asked for can be written, and that no result of before is
    overwritten.

    Args:
        force: results of before may be overwritten. paths: by their options' names.

    Raises:
        OutputError: one can't be written or is there already, or two are the same.
    """
    seen: set[Path] = set()
    for name, given in paths.items():
        option = "--" + name.replace("_", "-")
        for path in [given] if isinstance(given, Path) else given or ():
            check_file(path, force, option)
            if path.resolve() in seen and not is_stream(path):
                raise OutputError(f"{option} is '{path}', which another option names too. Give each result a file of its own.")
            seen.add(path.resolve())


def command_line() -> str:
    """The command that runs, as it was given, for the provenance of what it writes."""
    return shlex.join(["sysid", *(click.get_current_context().find_root().obj or [])])


def note(sentence: str) -> None:
    """A message on stderr: one line, which a terminal shows with its words whole."""
    if sys.stderr.isatty():
        Console(stderr=True, highlight=False, markup=False, emoji=False).print(sentence)
    else:
        click.echo(sentence, err=True)


def warn(sentence: str) -> None:
    """A warning on stderr."""
    note(f"Warning: {sentence}")


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a document for machines."""
    write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")


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
