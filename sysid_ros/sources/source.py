"""What every source of joint states offers; one of records in memory; and where the URDF comes from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol

from sysid_ros.exceptions import RobotModelError, in_a_line
from sysid_ros.robot.mjcf import is_mjcf, urdf_of_mjcf
from sysid_ros.robot.xacro_file import is_xacro, urdf_of_xacro, with_arguments
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


def urdf_text(urdf_path: str | Path | None, source: Source | None = None) -> str:
    """The URDF's text from ``urdf_path``, else from the ``/robot_description`` that was recorded with the data. An MJCF gives
    what :func:`.urdf_of_mjcf` makes of it, a xacro file what xacro does, with arguments behind its path ("arm.xacro side:=left").

    Raises:
        RobotModelError: there is no such file, it is not text, or neither of the two gives a URDF.
    """
    if urdf_path is None or str(urdf_path) == "":
        if source is not None and (text := source.robot_description) is not None:
            return text
        where = "no URDF file is given" if source is None else "no URDF file is given and the data hold no /robot_description"
        raise RobotModelError(f"{where}. Give the robot's URDF with --urdf FILE, or record /robot_description with the bag.")
    given, arguments = with_arguments(str(urdf_path))
    path = Path(given)
    if path.is_dir():
        raise RobotModelError(f"URDF '{path}' is a folder. Give the .urdf file itself.")
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise RobotModelError(f"URDF '{path}' does not exist. Give the path of the robot's .urdf file.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise RobotModelError(
            f"URDF '{path}' can't be read: {in_a_line(error)}. Give the path of the robot's .urdf file."
        ) from error
    if is_mjcf(text):
        return urdf_of_mjcf(path)
    if is_xacro(path, text):
        return urdf_of_xacro(path, arguments)
    if arguments:
        raise RobotModelError(f"'{path}' is no xacro file, so it takes no arguments: {' '.join(arguments)}. Leave them out.")
    return text
