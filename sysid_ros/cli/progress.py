"""How long it will take: one display on stderr for all commands, where a person watches; a few plain lines in a log."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column

from sysid_ros.cli.output import note

_NARROW = 60
"""Columns of a terminal below which what is being done and how far it is must do."""


class Advance(Protocol):
    """Moves a progress bar on by so many steps."""

    def __call__(self, steps: int) -> None: ...


@contextmanager
def progress_bar(what: str, total: int) -> Iterator[Advance]:
    """A bar on stderr, or nothing where nobody watches."""
    if not _watched():
        yield lambda steps: None
        return
    bar = BarColumn(bar_width=None, table_column=Column(ratio=2))
    with _display(bar, TaskProgressColumn(), TimeRemainingColumn(compact=True)) as progress:
        task = progress.add_task(what, total=total)
        yield lambda steps: progress.advance(task, steps)


@contextmanager
def stages() -> Iterator[Callable[[str], None]]:
    """Takes sentences on what is being done: the last one stands where a person watches; in a log each is a line, with the
    seconds since the start."""
    started = time.monotonic()
    if not _watched():
        yield lambda sentence: note(f"{time.monotonic() - started:5.1f} s  {sentence}")
        return
    with _display(TimeElapsedColumn(), spinner=True) as progress:
        task = progress.add_task("", total=None)
        yield lambda sentence: progress.update(task, description=sentence)


@contextmanager
def said_if_slow(what: str, after: float = 1.5) -> Iterator[None]:
    """Say what is being done, and for how long it has been, where it takes longer than ``after`` [s]: a line on stderr that goes
    where a person watches, and stays in a log."""
    done = threading.Event()

    def say() -> None:
        if done.wait(after):
            return
        if not _watched():
            note(f"{what}.")
            return
        with _display(TimeElapsedColumn(), spinner=True) as progress:
            progress.add_task(what, total=None)
            done.wait()

    said = threading.Thread(target=say, daemon=True)
    said.start()
    try:
        yield
    finally:
        done.set()
        said.join()


def _watched() -> bool:
    """Whether stderr is a terminal that can draw a line again."""
    return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"


def _display(*columns: ProgressColumn, spinner: bool = False) -> Progress:
    """One line, never wrapped: a long sentence is cut to what the terminal has room for."""
    console = Console(stderr=True)
    what = TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True, overflow="ellipsis", ratio=3))
    first = [SpinnerColumn()] if spinner else []
    rest = [c for c in columns if console.width >= _NARROW or isinstance(c, TaskProgressColumn | TimeElapsedColumn)]
    return Progress(*first, what, *rest, console=console, transient=True, expand=True)
