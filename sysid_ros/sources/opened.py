"""open_source: what a path holds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sysid_ros.sources.bag import BagSource
from sysid_ros.sources.table import SUFFIXES, TableSource, read_table


def open_source(path: Path, topic: str = "/joint_states", columns: Mapping[str, Any] | None = None) -> BagSource | TableSource:
    """The bag or the table at a path.

    Args:
        topic: of the joint states in a bag. columns: of a table, as of :func:`.columns.read_columns`.

    Raises:
        BagError, DataError: it can't be read.
    """
    if path.suffix.lower() in SUFFIXES:
        return read_table(path, columns)
    return BagSource(path, topic)
