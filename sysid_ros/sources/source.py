"""What every source of joint states offers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from sysid_ros.sample import JointStateRecord


class Source(Protocol):
    """Joint states in the order in which they were received; it can be iterated again from the start."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The joints that messages have named so far, in the order in which they came up."""

    @property
    def message_count(self) -> int:
        """How many records there are, for a progress bar."""

    @property
    def duration(self) -> float:
        """Receive time of the last record minus that of the first [s]."""

    @property
    def robot_description(self) -> str | None:
        """The URDF that came with the data."""

    @property
    def notes(self) -> list[str]:
        """What the user should know of how the data were read, one sentence each."""

    def __iter__(self) -> Iterator[JointStateRecord]:
        """The records."""
