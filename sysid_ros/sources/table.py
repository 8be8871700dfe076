"""TableSource: joint states from a table: CSV, Parquet, npz, a data frame, or arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from sysid_ros.exceptions import DataError, in_a_line
from sysid_ros.files import whole, write_text
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.sources.columns import RADIANS, SECONDS, columns_of
from sysid_ros.sources.comma_separated import read_csv

SUFFIXES = (".csv", ".tsv", ".parquet", ".npz")
"""Of files that hold a table."""
_LONGEST_STEP = 0.5
"""Between rows [s]: slower than that no robot's dynamics show."""
_KEYS = {"t": ("t", "time"), "q": ("q", "position"), "v": ("v", "velocity"), "tau": ("tau", "effort")}


class TableSource:
    """Joint states of one robot at rows of a table, with the properties of a bag.

    Args:
        name: where it comes from, for messages.
        t: stamps, shape (N,) [s]. q, tau: positions and efforts, shape (N, n). v: velocities alike, or None.
        joint_names: n names; empty where the table does not name them, see :meth:`named`.
        robot_description: the URDF that belongs to them. notes: what the user should know of how they were read.

    Raises:
        DataError: the shapes do not fit one another.
    """

    def __init__(
        self,
        name: str,
        t: FloatArray,
        q: FloatArray,
        tau: FloatArray,
        v: FloatArray | None = None,
        joint_names: Sequence[str] = (),
        robot_description: str | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        self.name, self.joint_names, self.robot_description = name, tuple(joint_names), robot_description
        self.notes = list(notes)
        self.t, self.q, self.tau = (_numbers(name, x) for x in (t, q, tau))
        self.v = None if v is None else _numbers(name, v)
        shapes = [x.shape for x in (self.q, self.tau, self.v) if x is not None]
        expected = (len(self.t), self.q.shape[1] if self.q.ndim == 2 else -1)
        if self.t.ndim != 1 or any(shape != expected for shape in shapes):
            raise DataError(
                f"{name}: time has the shape {self.t.shape}, position, effort and velocity {', '.join(map(str, shapes))}; they "
                "must be (N,) and (N, n)."
            )
        if self.joint_names and len(self.joint_names) != expected[1]:
            raise DataError(
                f"{name}: {len(self.joint_names)} joints are named and {expected[1]} have columns. Name each of them."
            )
        if len(self.t) == 0:
            raise DataError(f"{name}: the table has no row.")
        if not np.isfinite(self.t).any():
            raise DataError(f"{name}: no time in it is a number. Correct the column, or say which it is (--columns).")
        first = float(np.min(self.t[np.isfinite(self.t)]))
        if not first > 0.0:  # a stamp of zero says of a message that nobody filled it in
            shift = 1.0 - first
            self.t = self.t + shift
            self.notes.append(f"Times in {name} begin at {1.0 - shift:g} s; {shift:g} s is added to all of them.")

    def named(self, urdf_joints: Sequence[str]) -> Self:
        """The same with the URDF's joints for names, in its order, where the table has none.

        Raises:
            DataError: their number is another.
        """
        if self.joint_names:
            return self
        n = self.q.shape[1]
        if len(urdf_joints) != n:
            raise DataError(
                f"{self.name} has {n} joints without names, the URDF has {len(urdf_joints)}: {', '.join(urdf_joints)}. Say which "
                "they are: joints: [...] in the mapping for --columns."
            )
        notes = [*self.notes, f"Joints of {self.name} are taken for the URDF's, in its order: {', '.join(urdf_joints)}."]
        return type(self)(self.name, self.t, self.q, self.tau, self.v, urdf_joints, self.robot_description, notes)

    def renamed(self, names: Mapping[str, str]) -> Self:
        """The same with other names for some joints, by the names that it has."""
        joints = tuple(names.get(name, name) for name in self.joint_names)
        pairs = ", ".join(f"{old} is {new}" for old, new in names.items())
        notes = [*self.notes, f"Joints of {self.name} are taken for the URDF's: {pairs}."]
        return type(self)(self.name, self.t, self.q, self.tau, self.v, joints, self.robot_description, notes)

    @property
    def message_count(self) -> int:
        """How many rows there are."""
        return len(self.t)

    @property
    def duration(self) -> float:
        """From the first row to the last [s]."""
        return float(self.t[-1] - self.t[0])

    def __iter__(self) -> Iterator[JointStateRecord]:
        names, none = self.joint_names, np.empty(0)
        for k, t in enumerate(self.t.tolist()):
            yield JointStateRecord(t, t, names, self.q[k], none if self.v is None else self.v[k], self.tau[k])


def read_table(path: Path, columns: Mapping[str, Any] | None = None) -> TableSource:
    """The table in a file.

    Args:
        columns: which are which, as of :func:`.columns.read_columns`; guessed from their names where it is None.

    Raises:
        DataError: the file can't be read, or it does not say what is what.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"table '{path}' does not exist.")
    if path.suffix == ".npz":
        source = _of_npz(path, columns)
    else:
        names, values = _parquet(path) if path.suffix == ".parquet" else read_csv(path)
        source = of_columns(str(path), names, values, columns)
    steps = np.diff(source.t[np.isfinite(source.t)])
    if (step := float(np.median(np.abs(steps))) if steps.size else 0.0) > _LONGEST_STEP:
        raise DataError(
            f"table '{path}': its rows are {step:.3g} s apart; {_LONGEST_STEP:g} s is the most that can be used. Where its times "
            "are not in seconds, say so in the mapping for --columns: time_unit: ms, us or ns (npz: convert t)."
        )
    return source


def of_columns(name: str, names: Sequence[str], values: FloatArray, given: Mapping[str, Any] | None) -> TableSource:
    """The table of named columns, shape (N, number of names)."""
    columns = columns_of(names, given, name)
    notes = [*([columns.text] if columns.guessed else []), *columns.notes]
    used = (columns.time, *columns.position, *columns.velocity, *columns.effort)
    if twice := next((column for column in used if names.count(column) > 1), None):
        raise DataError(f"{name}: two columns are called '{twice}'. Give each a name of its own.")
    at = {column: k for k, column in enumerate(names)}

    def of(some: Sequence[str], scale: float = 1.0) -> FloatArray:
        return np.asarray(values[:, [at[x] for x in some]] * scale)

    angle = RADIANS[columns.position_unit]
    velocity = of(columns.velocity, angle) if columns.velocity else None
    t = of([columns.time], 1.0)[:, 0]
    if columns.time_unit != "s":
        t = t * SECONDS[columns.time_unit]
    return TableSource(name, t, of(columns.position, angle), of(columns.effort), velocity, columns.joints, notes=notes)


def of_frame(frame: Any, name: str, given: Mapping[str, Any] | None = None) -> TableSource:
    """The table in a pandas or polars data frame; an index that is no running number counts as time."""
    names = [str(x) for x in frame.columns]
    values = np.asarray(frame.to_numpy(), dtype=float)
    index = getattr(frame, "index", None)
    if index is not None and not {"t", "time"} & set(names) and getattr(index, "dtype", None) is not None:
        stamps = np.asarray(index)
        stamps = stamps.astype("int64") * 1e-9 if stamps.dtype.kind == "M" else stamps.astype(float)
        names, values = [*names, "t"], np.column_stack([values, stamps])
    return of_columns(name, names, values, given)


def write_table(path: Path, source: TableSource) -> None:
    """The table as .csv, .npz or .parquet, from which the same numbers are read.

    Raises:
        DataError: the suffix is another, or what it needs is not installed.
    """
    joints = source.joint_names or tuple(str(k + 1) for k in range(source.q.shape[1]))
    if path.suffix == ".npz":
        arrays: dict[str, Any] = {"t": source.t, "q": source.q, "tau": source.tau}
        arrays["joint_names"] = np.array(source.joint_names, dtype=str)
        if source.v is not None:
            arrays["v"] = source.v
        with whole(path) as beside, beside.open("wb") as file:
            np.savez(file, **arrays)
        return
    parts = [("position", source.q), ("velocity", source.v), ("effort", source.tau)]
    names = ["time", *(f"{what}_{joint}" for what, x in parts if x is not None for joint in joints)]
    values = np.column_stack([source.t, *(x for _, x in parts if x is not None)])
    if path.suffix == ".csv":
        lines = [",".join(names), *(",".join(map(repr, row)) for row in values.tolist())]
        write_text(path, "\n".join(lines) + "\n")
    elif path.suffix == ".parquet":
        pyarrow, parquet = _arrow(path)
        with whole(path) as beside:
            parquet.write_table(pyarrow.table(dict(zip(names, values.T, strict=True))), beside)
    else:
        raise DataError(f"'{path}' can't be written: the suffix must be .csv, .npz or .parquet.")


def _numbers(name: str, values: Any) -> FloatArray:
    try:
        array = np.asarray(values)
        if array.dtype.kind == "c":
            raise TypeError("complex numbers")
        return np.ascontiguousarray(array, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{name}: it holds something else than real numbers: {in_a_line(error)}. Give times, positions and efforts."
        ) from None


def _parquet(path: Path) -> tuple[list[str], FloatArray]:
    _, parquet = _arrow(path)
    try:
        table = parquet.read_table(path)
        return list(map(str, table.column_names)), np.column_stack([np.asarray(x, dtype=float) for x in table.columns])
    except Exception as error:
        raise DataError(f"table '{path}' can't be read as Parquet: {in_a_line(error)}. Write it again.") from error


def _arrow(path: Path) -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise DataError(f"'{path}' needs pyarrow: pip install 'sysid_ros[tables]'. CSV and npz need nothing.") from None
    return pyarrow, parquet


def _of_npz(path: Path, columns: Mapping[str, Any] | None) -> TableSource:
    """The arrays t, q, tau of a file, or its columns: arrays of one column each, or of several, which get numbers."""
    try:
        with np.load(path, allow_pickle=False) as file:
            held = {name: file[name] for name in file}
    except Exception as error:
        reason = "it holds no arrays of numbers" if "pickle" in str(error) else in_a_line(error)
        raise DataError(f"table '{path}' can't be read as npz: {reason}. Write it again with numpy.savez.") from error
    t, q, v, tau = (next((held[name] for name in names if name in held), None) for names in _KEYS.values())
    if columns is None and t is not None and q is not None and tau is not None:
        return TableSource(str(path), t, q, tau, v, [str(name) for name in held.get("joint_names", ())])
    table = {name: values for name, values in held.items() if values.ndim in (1, 2) and values.dtype.kind in "fiu"}
    rows = max((len(values) for values in table.values()), default=0)
    flat = {
        name if values.ndim == 1 else f"{name}_{k}": column
        for name, values in table.items()
        if len(values) == rows
        for k, column in enumerate(values.reshape(rows, -1).T)
    }
    try:
        return of_columns(str(path), list(flat), np.column_stack([np.asarray(x, dtype=float) for x in flat.values()]), columns)
    except (DataError, ValueError) as error:
        if columns is not None and isinstance(error, DataError):
            raise
        raise DataError(
            f"'{path}' holds {', '.join(held) or 'nothing'}; it must hold t (N,), q (N, n), tau (N, n), and may hold v; or "
            "arrays with the names that the columns of a CSV would have, or --columns must name them."
        ) from error
