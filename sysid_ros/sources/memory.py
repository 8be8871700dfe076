"""MemorySource: joint states that are already in memory, for tests and for loops without a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from sysid_ros.sample import JointStateRecord


class MemorySource:
    """Records from any iterable, with the properties of a bag.

    Args:
        records: in the order in which they were received. robot_description: the URDF that belongs to them.
    """

    def __init__(self, records: Iterable[JointStateRecord], robot_description: str | None = None) -> None:
        self._records = tuple(records)
        self.robot_description = robot_description
        self.notes: list[str] = []

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints that any record names, in the order in which they come up."""
        return tuple(dict.fromkeys(name for names in dict.fromkeys(r.names for r in self._records) for name in names))

    @property
    def message_count(self) -> int:
        """How many records there are."""
        return len(self._records)

    @property
    def duration(self) -> float:
        """Receive time of the last record minus that of the first [s]."""
        return self._records[-1].receive_time - self._records[0].receive_time if self._records else 0.0

    def __iter__(self) -> Iterator[JointStateRecord]:
        return iter(self._records)
