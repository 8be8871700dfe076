"""Recording, load: what a robot published, from a bag, a table, a data frame or arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.exceptions import DataError
from sysid_ros.sources import BagSource, TableSource, open_source
from sysid_ros.sources.columns import read_columns
from sysid_ros.sources.table import of_frame, write_table


class Recording:
    """Joint states of one robot over a time.

    Args:
        name: for tables and messages. source: where they come from.
    """

    def __init__(self, name: str, source: BagSource | TableSource) -> None:
        self.name, self.source = name, source

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Those that the messages name; empty where a table names none."""
        return self.source.joint_names

    @property
    def duration(self) -> float:
        """[s]"""
        return self.source.duration

    @property
    def urdf(self) -> str | None:
        """The URDF that was recorded with it."""
        return self.source.robot_description

    @property
    def notes(self) -> list[str]:
        """What one should know of how it was read."""
        return list(self.source.notes)

    def arrays(self) -> TableSource:
        """All of it as arrays: ``t`` (N,) [s], ``q``, ``v`` or None, ``tau``, each (N, n), ``joint_names``.

        Raises:
            DataError: messages differ in their joints, or some lack positions or efforts.
        """
        if isinstance(self.source, TableSource):
            return self.source
        records = list(self.source)
        names = {r.names for r in records}
        if len(names) != 1 or any(len(r.position) != len(r.names) or len(r.effort) != len(r.names) for r in records):
            raise DataError(f"{self.name}: its messages name different joints, or lack values, so that they are no table.")
        velocity = all(len(r.velocity) == len(r.names) for r in records)
        t, q, tau = (np.array([getattr(r, what) for r in records]) for what in ("stamp", "position", "effort"))
        v = np.array([r.velocity for r in records]) if velocity else None
        return TableSource(self.name, t, q, tau, v, records[0].names, self.urdf)

    def save(self, path: str | Path) -> Path:
        """Write it as a table: .csv, .npz or .parquet."""
        write_table(Path(path), self.arrays())
        return Path(path)

    def __repr__(self) -> str:
        n = self.source.message_count
        rate = n / max(self.duration, 1e-9)
        lines = [
            f"Recording {self.name}: {n} joint states, {self.duration:.2f} s, {rate:.0f} Hz",
            f"  {', '.join(self.joint_names) or 'joints without names'}",
            "  with its URDF" if self.urdf else "  without a URDF: give a Robot",
        ]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])


def load(
    path: Any = None,
    *,
    topic: str = "/joint_states",
    columns: Mapping[str, Any] | str | Path | None = None,
    t: Any = None,
    q: Any = None,
    tau: Any = None,
    v: Any = None,
    joint_names: Sequence[str] = (),
    name: str = "",
) -> Recording:
    """A recording from a rosbag2 folder, .mcap, .db3, .csv, .parquet, .npz, a data frame, or arrays.

    Args:
        path: of a file or folder, or a pandas or polars data frame; None where arrays are given.
        topic: of the joint states in a bag.
        columns: of a table: which are which, a mapping or the path of one in YAML (``time``, ``position``, ``effort``, and where
            wanted ``velocity``, ``joints``, ``time_unit``, ``position_unit``); guessed from their names without it.
        t: stamps, shape (N,) [s]. q, tau: positions [rad or m] and efforts [N m or N], shape (N, n). v: velocities alike.
        joint_names: of arrays; without them they are the robot's, in its order.
        name: for messages; else that of the file.

    Raises:
        BagError, DataError: it can't be read, or does not tell what is what.
    """
    if path is None:
        if t is None or q is None or tau is None:
            raise DataError("load() needs a path, a data frame, or arrays: t, q and tau.")
        return Recording(name or "arrays", TableSource(name or "arrays", t, q, tau, v, joint_names))
    given = read_columns(Path(columns)) if isinstance(columns, str | Path) else columns
    if hasattr(path, "columns") and hasattr(path, "to_numpy"):
        return Recording(name or "data frame", of_frame(path, name or "data frame", given))
    path = Path(path)
    return Recording(name or path.name, open_source(path, topic, given))
