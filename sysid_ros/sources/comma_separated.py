"""read_csv: names and values of a text of columns, and in words what is wrong in which line of it."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.sample import FloatArray

_MARKS = (",", ";", "\t", "|")
_NOTHING = ("", "nan", "null", "none", "na", "n/a")
"""Words for a value that is not there."""


def read_csv(path: Path) -> tuple[list[str], FloatArray]:
    """Names in the first line, shape (k,), and the numbers below, shape (N, k); NaN where there is none.

    Between the columns may be commas, semicolons, tabs, bars or blanks; where it is no comma, a comma may be the decimal mark. A
    byte order mark and quotes are passed over.

    Raises:
        DataError: it is no such text; it says in which line.
    """
    try:
        head, _, rest = path.read_text(encoding="utf-8-sig").partition("\n")
    except UnicodeDecodeError:
        raise DataError(f"table '{path}' is not text in UTF-8. Export it again as CSV in UTF-8.") from None
    except OSError as error:
        raise DataError(f"table '{path}' can't be read: {error.strerror}.") from None
    if not head.strip():
        raise DataError(f"table '{path}' is empty. Its first line must name the columns, the others hold numbers.")
    mark = max(_MARKS, key=head.count)
    between = mark if mark in head else None
    names = [name.strip().strip("\"'") for name in (head.split(between))]
    if not rest.strip():
        raise DataError(f"table '{path}' has names in its first line and no rows below. Export it again with its values.")
    if between != "," and _decimal_commas(rest, between):
        rest = rest.replace(",", ".")
    try:
        values = np.loadtxt(io.StringIO(rest), delimiter=between, ndmin=2, comments=None, quotechar='"')
    except ValueError:
        values = _one_by_one(path, names, rest, between)
    if values.shape[1] != len(names):
        raise DataError(_of_another_length(path, 2, values.shape[1], len(names)))
    return names, values


def _decimal_commas(rest: str, between: str | None) -> bool:
    first = rest.partition("\n")[0]
    return "," in first and "." not in first and all(value.count(",") <= 1 for value in first.split(between))


def _one_by_one(path: Path, names: Sequence[str], rest: str, between: str | None) -> FloatArray:
    """The same with blank values, value by value: the first that is no number is told with its place."""
    lines = (line.split() for line in rest.splitlines()) if between is None else csv.reader(rest.splitlines(), delimiter=between)
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=2):
        if not line:
            continue
        if len(line) != len(names):
            raise DataError(_of_another_length(path, number, len(line), len(names)))
        for name, text in zip(names, line, strict=True):
            if text.strip().lower() not in _NOTHING and not _is_number(text):
                raise DataError(
                    f"table '{path}', line {number}, column '{name}': '{text[:40]}' is no number. Correct it, or leave it blank."
                )
        rows.append([float(text) if _is_number(text) else np.nan for text in line])
    return np.array(rows)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _of_another_length(path: Path, line: int, found: int, named: int) -> str:
    return (
        f"table '{path}' has {named} names in its first line and {found} values in line {line}; each column needs a name, each "
        "row a value for it. Commas, semicolons, tabs, bars or blanks may stand between them, everywhere the same."
    )
