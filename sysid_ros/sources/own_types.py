"""Message types that ROS 2 itself does not bring, by the definitions that a bag stores with its topics."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from rosbags.interfaces import MessageDefinitionFormat
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from sysid_ros.exceptions import BagError


def own_types(definition: Any, kind: str, fallback: str = "") -> dict[str, Any]:
    """The types that a definition holds, as rosbags parses them: name to constants and fields.

    Args:
        definition: rosbags' ``MessageDefinition`` of a topic. kind: its type. fallback: where the bag has none, as sqlite3 bags
            before ROS 2 Iron.

    Raises:
        BagError: there is none, or it can't be read.
    """
    try:
        if definition.format == MessageDefinitionFormat.MSG:
            return dict(get_types_from_msg(definition.data, kind))
        if definition.format == MessageDefinitionFormat.IDL:
            return dict(get_types_from_idl(definition.data))
        if fallback:
            return dict(get_types_from_msg(fallback, kind))
    except Exception as error:
        raise BagError(f"the bag's definition of {kind} can't be read: {error}.") from error
    raise BagError(f"the bag does not define {kind}. Record to mcap, which does.")


def store_of(types: dict[str, Any]) -> Any:
    """rosbags' store of these types alone."""
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


class MessageReader:
    """Reads messages of one type up to the last field that is asked for: what comes behind costs no time.

    Args:
        types: as of :func:`own_types`. kind: the type. wanted: names of fields, in lower case; those that are not there are
            passed over.

    Attributes:
        fields: that are wanted and there, by their names in lower case.
    """

    def __init__(self, types: dict[str, Any], kind: str, wanted: Collection[str]) -> None:
        constants, fields = types[kind]
        found = [k for k, (name, _) in enumerate(fields) if name.lower() in wanted]
        self.fields = {fields[k][0].lower(): fields[k][0] for k in found}
        self._store = store_of(types | {kind: (constants, fields[: max(found, default=-1) + 1])})
        self._kind = kind

    def read(self, data: bytes) -> dict[str, Any]:
        """The fields of a message by their names in lower case.

        Raises:
            ValueError: it is no message of the type.
        """
        if data[:2] not in (b"\x00\x00", b"\x00\x01"):
            raise ValueError(f"{len(data)} bytes that are not a {self._kind}")
        definition = self._store.get_msgdef(self._kind)
        read = definition.deserialize_cdr_le if data[1] else definition.deserialize_cdr_be
        try:
            message, _ = read(data[4:], 0, definition.cls, self._store)
        except Exception as error:
            raise ValueError(f"{len(data)} bytes that are not a {self._kind} ({type(error).__name__}: {error})") from error
        return {lower: getattr(message, name) for lower, name in self.fields.items()}
