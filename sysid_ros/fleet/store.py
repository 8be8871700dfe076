"""Store: what the jobs of a fleet found, in a folder of Parquet files that many tools read."""

from __future__ import annotations

import fcntl
import json
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sysid_ros.exceptions import OutputError, SettingsError
from sysid_ros.files import whole, write_text
from sysid_ros.fleet.schema import ORDER, PARTITION, SCHEMA_VERSION, TABLES, require_pyarrow, schema_of

_ABOUT = "store.json"
_REPLACES = b"sysid_replaces"
_FEW_PARTS = 4
"""Part files of a month that are left as they are: rewriting them would cost more than it saves."""

KEY = ("hash", "model", "version", "job")
"""Columns that make a :class:`Done`."""

Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Done:
    """What makes a job's result the same: the content of the bag, what the robot was known by, the package and the job."""

    hash: str
    model: str
    version: str
    job: str


@dataclass(slots=True)
class Results:
    """Rows of one job on one bag: ``bag`` for the table bags, and those of the others, see :mod:`.schema`."""

    bag: dict[str, Any]
    joints: list[dict[str, Any]] = field(default_factory=list)
    payloads: list[dict[str, Any]] = field(default_factory=list)
    events: list[dict[str, Any]] = field(default_factory=list)

    @property
    def month(self) -> str:
        """Of the bag's date in UTC, as 2026-03; ``unknown`` without one."""
        return month_of(self.bag.get("date"))


def month_of(date: datetime | None) -> str:
    """The part of a store that a date belongs to, as 2026-03; ``unknown`` without one."""
    return "unknown" if date is None else date.astimezone(UTC).strftime("%Y-%m")


class Store:
    """A folder of Parquet files: ``TABLE/month=2026-03/part-ID.parquet``.

    Results are appended as new part files, never into one that is there. Files of the same ID and month were written together,
    that of the table ``bags`` last: while it is missing, the others don't count, and are removed by the next writer. So what a
    stop at any instant leaves is a store that holds some results whole, and no others.

    One process writes at a time, inside :meth:`writing`. Any number may read.

    Args:
        path: of the folder. create: make it where it is not there.

    Raises:
        SettingsError: it is no store, or one of another version of the tables; or pyarrow is not installed.
        OutputError: it can't be made.
    """

    def __init__(self, path: str | Path, create: bool = False) -> None:
        require_pyarrow()
        self.path = Path(path)
        about = self.path / _ABOUT
        if create and not about.exists():
            self._make(about)
        try:
            version = json.loads(about.read_text(encoding="utf-8"))["schema_version"]
        except FileNotFoundError:
            raise SettingsError(
                f"'{path}' is no store: it holds no {_ABOUT}. `sysid batch ... --out {path}` makes one."
            ) from None
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SettingsError(f"'{about}' can't be read ({error}). It says which version of the tables a store has.") from None
        if version != SCHEMA_VERSION:
            raise SettingsError(
                f"store '{path}' has tables of version {version}; this package reads version {SCHEMA_VERSION}. Make a new store "
                "from the bags, or use the package that wrote it."
            )

    def _make(self, about: Path) -> None:
        if self.path.exists() and (not self.path.is_dir() or any(self.path.iterdir())):
            raise OutputError(f"'{self.path}' is there and is no store. Choose a new folder, or an empty one.")
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"folder '{self.path}' can't be made: {error.strerror}.") from None
        write_text(about, json.dumps({"schema_version": SCHEMA_VERSION, "made": datetime.now(UTC).isoformat()}) + "\n")

    @contextmanager
    def writing(self) -> Iterator[None]:
        """The right to write, for one process at a time; what writers of before left half done is removed first.

        Raises:
            OutputError: another process has it.
        """
        with open(self.path / ".lock", "w", encoding="utf-8") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise OutputError(
                    f"another process writes to store '{self.path}'. Wait for it, or choose another store."
                ) from None
            self.clean()
            yield

    def append(self, results: Sequence[Results]) -> None:
        """Write results: those of each month come in whole, or not at all.

        Raises:
            OutputError: they can't be written; those of some months may be in, and are done then.
        """
        by_month: dict[str, list[Results]] = {}
        for one in results:
            by_month.setdefault(one.month, []).append(one)
        for month, some in sorted(by_month.items()):
            rows: dict[str, list[Row]] = {
                "bags": [x.bag | {"schema_version": SCHEMA_VERSION} for x in some],
                "joints": [row for x in some for row in x.joints],
                "payloads": [row for x in some for row in x.payloads],
                "events": [row for x in some for row in x.events],
            }
            self._write(month, {name: _table(name, given) for name, given in rows.items()}, ())

    def read(self, table: str, columns: Sequence[str] | None = None, months: Sequence[str] | None = None) -> Any:
        """A table as a ``pyarrow.Table``, in the order of :data:`.schema.ORDER`, which does not depend on who wrote what when.

        Args:
            table: one of :data:`.schema.TABLES`. columns: those wanted; all without. months: as 2026-03; all without.

        Raises:
            SettingsError: there is no such table or column.
        """
        pa, schema = require_pyarrow(), schema_of(table)
        if unknown := sorted(set(columns or ()) - set(schema.names)):
            raise SettingsError(f"table '{table}' has no column {', '.join(unknown)}; it has {', '.join(schema.names)}.")
        wanted = list(columns) if columns is not None else list(schema.names)
        needed = list(dict.fromkeys([*wanted, *ORDER[table]]))
        parts = [
            _read_part(file, schema, needed)
            for month in self.months()
            if months is None or month in months
            for name in sorted(self._valid(month))
            if (file := self._file(table, month, name)).exists()
        ]
        nothing = pa.schema([schema.field(name) for name in needed]).empty_table()
        whole_table = pa.concat_tables([nothing, *parts])
        return whole_table.sort_by([(name, "ascending") for name in ORDER[table]]).select(wanted)

    def done(self, failed: bool = True) -> set[Done]:
        """What was done already, with what failed unless ``failed`` is False."""
        rows = self.read("bags", [*KEY, "status"]).to_pydict()
        keys = zip(*(rows[name] for name in KEY), rows["status"], strict=True)
        return {Done(*key[:4]) for key in keys if failed or key[4] == "ok"}

    def forget(self, keys: Iterable[Done]) -> int:
        """Take the rows of these results out, to do them again; how many results that were."""
        pa, gone = require_pyarrow(), set(keys)
        count = 0
        for month in self.months():
            names = sorted(self._valid(month))
            kept: dict[str, Any] = {}
            for table in TABLES:
                rows = self._joined(table, month, names)
                of = (rows.column(name).to_pylist() for name in KEY)
                keep = [Done(*key) not in gone for key in zip(*of, strict=True)]
                if table == "bags" and all(keep):
                    break
                count += keep.count(False) if table == "bags" else 0
                kept[table] = rows.filter(pa.array(keep, pa.bool_()))
            if kept:
                self._write(month, kept, names)
        return count

    def compact(self, few: int = _FEW_PARTS) -> int:
        """Join the part files of each month that has more than ``few`` of them; how many months that were.

        One month's rows are in memory at a time. A stop at any instant changes nothing of what :meth:`read` gives.
        """
        joined = 0
        self.clean()
        for month in self.months():
            names = sorted(self._valid(month))
            if len(names) > few:
                self._write(month, {table: self._joined(table, month, names) for table in TABLES}, names)
                joined += 1
        return joined

    def clean(self) -> None:
        """Remove files that don't count: of writers that were stopped, and those that were joined into another."""
        for month in self.months(everywhere=True):
            valid = self._valid(month)
            for table in TABLES:
                folder = self.path / table / f"{PARTITION}={month}"
                for file in folder.glob("*") if folder.is_dir() else ():
                    if _name(file) not in valid or file.suffix != ".parquet":
                        file.unlink(missing_ok=True)

    def _write(self, month: str, tables: Mapping[str, Any], replaces: Sequence[str]) -> None:
        """Files of a new ID, that of the bags last; it takes the place of the IDs ``replaces``."""
        name = secrets.token_hex(8)
        try:
            for table in sorted(TABLES, key=lambda x: x == "bags"):
                if len(tables[table]) or table == "bags":
                    rows = tables[table].sort_by([(column, "ascending") for column in ORDER[table]])
                    _write_part(self._file(table, month, name), rows, replaces)
        except BaseException:
            for table in TABLES:
                self._file(table, month, name).unlink(missing_ok=True)
            raise
        # the bags first: a file of bags without the others would count
        for old in replaces:
            for table in TABLES:
                self._file(table, month, old).unlink(missing_ok=True)

    def months(self, everywhere: bool = False) -> list[str]:
        """Those that the store has rows of; ``everywhere``: also those of which only rests of a writer are there."""
        tables = TABLES if everywhere else ("bags",)
        folders = {folder for table in tables for folder in (self.path / table).glob(f"{PARTITION}=*")}
        return sorted({folder.name.partition("=")[2] for folder in folders})

    def _valid(self, month: str) -> set[str]:
        """IDs of a month that count: whose file of bags is there, and that were not joined into another that counts."""
        from pyarrow import parquet

        files = {_name(file): file for file in (self.path / "bags" / f"{PARTITION}={month}").glob("part-*.parquet")}
        gone: set[str] = set()
        for file in files.values():
            gone.update(json.loads((parquet.read_schema(file).metadata or {}).get(_REPLACES, b"[]")))
        return set(files) - gone

    def _joined(self, table: str, month: str, names: Sequence[str]) -> Any:
        pa, schema = require_pyarrow(), schema_of(table)
        files = [file for name in names if (file := self._file(table, month, name)).exists()]
        return pa.concat_tables([schema.empty_table(), *(_read_part(file, schema, schema.names) for file in files)])

    def _file(self, table: str, month: str, name: str) -> Path:
        return self.path / table / f"{PARTITION}={month}" / f"part-{name}.parquet"


def _name(file: Path) -> str:
    return file.stem.removeprefix("part-")


def _table(name: str, rows: Sequence[Row]) -> Any:
    """Rows as a table; a column that a row lacks is null.

    Raises:
        SettingsError: a row has a column that the table has not.
    """
    pa, schema = require_pyarrow(), schema_of(name)
    if unknown := sorted({key for row in rows for key in row} - set(schema.names)):
        raise SettingsError(f"rows for table '{name}' have columns that it has not: {', '.join(unknown)}.")
    return pa.Table.from_pylist([dict(row) for row in rows], schema=schema)


def _read_part(file: Path, schema: Any, columns: Sequence[str]) -> Any:
    from pyarrow import parquet

    pa, part = require_pyarrow(), parquet.ParquetFile(file)
    fields = pa.schema([schema.field(name) for name in columns])
    there = [name for name in columns if name in part.schema_arrow.names]
    rows = part.read(columns=there)
    for name in columns:
        if name not in there:  # a column that came later
            rows = rows.append_column(name, pa.nulls(len(rows), schema.field(name).type))
    return rows.select(list(columns)).cast(fields)


def _write_part(file: Path, table: Any, replaces: Sequence[str]) -> None:
    from pyarrow import parquet

    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole(file) as beside:
            metadata = {**(table.schema.metadata or {}), _REPLACES: json.dumps(list(replaces)).encode()}
            parquet.write_table(table.replace_schema_metadata(metadata), beside, compression="zstd")
            with open(beside, "rb") as written:
                os.fsync(written.fileno())
    except OSError as error:
        said = error.strerror or str(error)
        raise OutputError(f"'{file}' can't be written: {said}. Make room, then give the command again.") from error
