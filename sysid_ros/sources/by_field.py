"""ByField: the base of decoders that read messages one by one, by the names of their fields."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from sysid_ros.sample import JointStateRecord
from sysid_ros.sources.own_types import MessageReader, own_types


class ByField:
    """Decodes messages of a type that the bag defines, see :class:`.joint_messages.Decoder`.

    Args:
        definition: of the type, from the bag. kind: the type. wanted: fields to read, in lower case. fallback: its definition
            where the bag has none.

    Raises:
        BagError: the type is not defined.
    """

    def __init__(self, definition: Any, kind: str, wanted: Collection[str], fallback: str = "") -> None:
        self.failures = 0
        self.last_failure = ""
        self.notes: list[str] = []
        self.names_joints = True
        self.kind = kind
        self.reader = MessageReader(own_types(definition, kind, fallback), kind, wanted)

    def record(self, fields: Mapping[str, Any], stamp: float, receive_time: float) -> JointStateRecord:
        """The record of a message.

        Args:
            fields: by their names in lower case. stamp: of the message [s].

        Raises:
            ValueError: its fields do not fit one another.
        """
        raise NotImplementedError

    def decode(self, messages: Sequence[bytes], receive_times: Sequence[float]) -> list[JointStateRecord]:
        """As of :class:`.joint_messages.Decoder`."""
        records = []
        for data, receive_time in zip(messages, receive_times, strict=True):
            try:
                fields = self.reader.read(data)
                stamp = fields["header"].stamp
                records.append(self.record(fields, stamp.sec + 1e-9 * stamp.nanosec, receive_time))
            except ValueError as error:
                self.failures += 1
                self.last_failure = str(error)
        return records
