"""``sensor_msgs/JointState`` to and from CDR, many messages at once.

A controller sends the same names in the same frame every time, so consecutive messages differ in nothing but the stamp and the
numbers. :class:`JointStateDecoder` finds where these stand in the first message of a kind, checks that the bytes in between are
the same in all others, and reads the numbers of all of them as one array. A message that is unlike any before is decoded field
by field; so the result never depends on which way was taken.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray, JointStateRecord

JOINT_STATE = "sensor_msgs/msg/JointState"
STRING = "std_msgs/msg/String"
_HEADER = 4  # bytes of CDR encapsulation, from which alignment is counted
_LITTLE_ENDIAN = b"\x00\x01"
_LAYOUTS_A_LENGTH = 8  # kinds of messages of one length that are remembered


@cache
def typestore() -> Any:
    """The message types of ROS 2, as rosbags has them; making them takes a while, and few need them."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


Bytes = slice | NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the numbers stand in all messages of one kind: ``arrays`` tells the bytes of position, velocity, effort."""

    names: tuple[str, ...]
    arrays: tuple[Bytes, ...]
    fixed: NDArray[np.intp]
    fixed_bytes: NDArray[np.uint8]


class JointStateDecoder:
    """Decodes batches of serialised ``sensor_msgs/JointState``, reference: OMG CDR (DDS-XTypes 1.3, section 7.4).

    Args:
        layout_of, one: of another type: where the numbers of a message stand, or None where that is not sure; the record of one
            message, which raises a ValueError.

    Attributes:
        failures: how many messages so far were not a JointState and were left out.
        last_failure: what was wrong with the last of them. notes, names_joints: see :class:`.joint_messages.Decoder`.
    """

    def __init__(
        self,
        layout_of: Callable[[bytes], Layout | None] | None = None,
        one: Callable[[bytes, float], JointStateRecord] | None = None,
    ) -> None:
        self._layout_of, self._one = layout_of or _layout_of, one or decode_one
        self.failures = 0
        self.last_failure = ""
        self.notes: list[str] = []
        self.names_joints = True
        self._layouts: dict[int, list[Layout]] = {}

    def decode(self, messages: Sequence[bytes], receive_times: Sequence[float]) -> list[JointStateRecord]:
        """Records of messages, in their order, without those that are not a JointState.

        Args:
            messages: N serialised messages. receive_times: N times [s].
        """
        by_length: dict[int, list[int]] = {}
        for index, message in enumerate(messages):
            by_length.setdefault(len(message), []).append(index)
        records: list[JointStateRecord | None] = [None] * len(messages)
        for indices in by_length.values():
            group = self._decode_equal_length([messages[i] for i in indices], [receive_times[i] for i in indices])
            for index, record in zip(indices, group, strict=True):
                records[index] = record
        return [record for record in records if record is not None]

    def _decode_equal_length(self, messages: Sequence[bytes], receive_times: Sequence[float]) -> list[JointStateRecord | None]:
        length = len(messages[0])
        table = np.frombuffer(b"".join(messages), dtype=np.uint8).reshape(len(messages), length)
        layouts = self._layouts.setdefault(length, [])
        records: list[JointStateRecord | None] = [None] * len(messages)
        left = np.arange(len(messages))
        tried = 0
        while len(left):
            if tried == len(layouts):
                first = int(left[0])
                if len(layouts) < _LAYOUTS_A_LENGTH and (layout := self._layout_of(messages[first])) is not None:
                    layouts.append(layout)
                    continue
                left = left[1:]
                try:
                    records[first] = self._one(messages[first], receive_times[first])
                except ValueError as error:
                    self.failures += 1
                    self.last_failure = str(error)
                continue
            layout = layouts[tried]
            tried += 1
            same = np.all(table[left][:, layout.fixed] == layout.fixed_bytes, axis=1)
            if not same.any():
                continue
            rows = left[same]
            left = left[~same]
            for row, record in zip(rows.tolist(), read(table[rows], layout, [receive_times[i] for i in rows]), strict=True):
                records[row] = record
        return records


def decode_one(message: bytes, receive_time: float) -> JointStateRecord:
    """One serialised JointState, field by field.

    Raises:
        ValueError: the message is not a JointState.
    """
    try:
        decoded = typestore().deserialize_cdr(message, JOINT_STATE)
    except Exception as error:
        raise ValueError(f"{len(message)} bytes that are not a {JOINT_STATE} ({type(error).__name__}: {error})") from error
    stamp = decoded.header.stamp
    position, velocity, effort = (
        np.array(array, dtype=np.float64) for array in (decoded.position, decoded.velocity, decoded.effort)
    )
    return JointStateRecord(
        stamp.sec + stamp.nanosec * 1e-9, receive_time, tuple(map(str, decoded.name)), position, velocity, effort
    )


def decode_string(message: bytes) -> str:
    """The text in a serialised ``std_msgs/String``.

    Raises:
        ValueError: the message is not a String.
    """
    size = len(message) - _HEADER - 4
    if message[:2] == _LITTLE_ENDIAN and size > 0 and message[_HEADER : _HEADER + 4] == struct.pack("<I", size):
        return message[_HEADER + 4 : -1].decode()
    try:
        return str(typestore().deserialize_cdr(message, STRING).data)
    except Exception as error:
        raise ValueError(f"{len(message)} bytes that are not a {STRING} ({type(error).__name__}: {error})") from error


def encode(record: JointStateRecord, prefix: bytes) -> bytes:
    """A record as CDR (little-endian); ``prefix`` is :func:`encode_names` of its names."""
    seconds, nanoseconds = divmod(round(record.stamp * 1e9), 1_000_000_000)
    out = bytearray(_LITTLE_ENDIAN + b"\x00\x00" + struct.pack("<iI", seconds, nanoseconds) + prefix)
    for array in (record.position, record.velocity, record.effort):
        out += struct.pack("<I", len(array))
        if len(array):
            out += bytes(-(len(out) - _HEADER) % 8)
            out += np.ascontiguousarray(array, dtype="<f8").tobytes()
    return bytes(out)


def encode_names(names: Sequence[str], frame_id: str = "") -> bytes:
    """What stands between the stamp and the positions of a JointState, as CDR."""
    out = bytearray(8)  # the stamp before it, for the alignment
    for text in (frame_id, None, *names):
        if text is None:
            out += bytes(-len(out) % 4) + struct.pack("<I", len(names))
            continue
        data = text.encode() + b"\x00"
        out += bytes(-len(out) % 4) + struct.pack("<I", len(data)) + data
    return bytes(out[8:] + bytes(-len(out) % 4))


def read(table: NDArray[np.uint8], layout: Layout, receive_times: Sequence[float]) -> list[JointStateRecord]:
    """The records of messages of one kind.

    Args:
        table: their bytes, shape (N, length). receive_times: N times [s].
    """
    times = np.ascontiguousarray(table[:, _HEADER : _HEADER + 8])
    stamps = times.view("<i4")[:, 0] + times.view("<u4")[:, 1] * 1e-9
    position, velocity, effort = (_doubles(table, where) for where in layout.arrays)
    names = layout.names
    return [
        JointStateRecord(stamp, receive_time, names, q, v, tau)
        for stamp, receive_time, q, v, tau in zip(stamps.tolist(), receive_times, position, velocity, effort, strict=True)
    ]


def _doubles(table: NDArray[np.uint8], where: Bytes) -> FloatArray:
    found = np.ascontiguousarray(table[:, where])
    return found.view("<f8").astype(np.float64, copy=False) if found.shape[1] else np.empty((len(table), 0))


def _layout_of(message: bytes) -> Layout | None:
    """The layout of a message, or None where it can't be sure of one (big-endian, other encapsulation, bytes left over)."""
    if message[:2] != _LITTLE_ENDIAN:
        return None
    fixed = [*range(_HEADER)]
    at = _HEADER + 8

    def count() -> int:
        nonlocal at
        at += -(at - _HEADER) % 4
        fixed.extend(range(at, at + 4))
        at += 4
        return int(struct.unpack_from("<I", message, at - 4)[0])

    def text() -> str:
        nonlocal at
        size = count()
        if size > len(message) - at:
            raise ValueError("a string that is longer than the message")
        fixed.extend(range(at, at + size))
        at += size
        characters, end = message[at - size : at - 1], message[at - 1 : at]
        if size == 0 or end != b"\x00" or b"\x00" in characters:
            raise ValueError("not a string that ends in zero")
        return characters.decode()

    try:
        text()
        names = tuple(text() for _ in range(count()))
        arrays = []
        for _ in range(3):
            size = count()
            at += (-(at - _HEADER) % 8) if size else 0
            arrays.append(slice(at, at + 8 * size))
            at += 8 * size
    except (struct.error, ValueError):
        return None
    if at != len(message):
        return None
    index = np.array(fixed, dtype=np.intp)
    return Layout(names, tuple(arrays), index, np.frombuffer(message, dtype=np.uint8)[index])
