"""``control_msgs/DynamicJointState``, which ros2_control's joint_state_broadcaster publishes beside the joint states."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.sources.by_field import ByField
from sysid_ros.sources.joint_state_cdr import JointStateDecoder, Layout, read

_RULE = 80 * "="
DEFINITION = f"""std_msgs/Header header
string[] joint_names
InterfaceValue[] interface_values
{_RULE}
MSG: control_msgs/InterfaceValue
string[] interface_names
float64[] values
{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
"""Of github.com/ros-controls/control_msgs, for bags that do not define it; it has been the same since ROS 2 Foxy."""
_INTERFACES = {"position": ("position",), "velocity": ("velocity",), "effort": ("effort", "torque")}
"""State interfaces of each quantity, the first that a joint has."""

Kind = tuple[tuple[str, ...], ...]


class InterfaceReader:
    """Joint states out of joints with the state interfaces that each has, in any order.

    Resources without a position (sensors, pins) are no joints. Where some joints have efforts, those without (a gripper) are left
    out, which is said; a velocity counts where all joints have one.

    Attributes:
        notes: what was left out, a sentence each.
    """

    def __init__(self) -> None:
        self.notes: list[str] = []
        self._layouts: dict[Kind, tuple[tuple[str, ...], list[list[int]]]] = {}

    def record(self, names: Sequence[str], parts: Sequence[Any], stamp: float, receive_time: float) -> JointStateRecord:
        """The joints with a position.

        Args:
            names: of the joints. parts: of each its ``interface_names`` and ``values``. stamp, receive_time: [s].

        Raises:
            ValueError: they are not as many as one another.
        """
        key = (tuple(names), *(tuple(part.interface_names) for part in parts))
        if (layout := self._layouts.get(key)) is None:
            layout = self._layouts[key] = self.layout(key)
        sizes = [len(part.values) for part in parts]
        if sizes != [len(interfaces) for interfaces in key[1:]]:
            raise ValueError("a DynamicJointState whose values are not as many as its interfaces")
        joints, index = layout
        values: FloatArray = np.concatenate([part.values for part in parts]) if parts else np.empty(0)
        q, v, tau = (values[some] for some in index)
        return JointStateRecord(stamp, receive_time, joints, q, v, tau)

    def layout(self, key: Kind) -> tuple[tuple[str, ...], list[list[int]]]:
        """The joints, and where in all values together their positions, velocities and efforts stand."""
        joints, *interfaces = key
        if len(joints) != len(interfaces):
            raise ValueError(f"a DynamicJointState with {len(joints)} joints and the interfaces of {len(interfaces)}")
        starts = np.cumsum([0, *map(len, interfaces)]).tolist()
        at: dict[str, dict[str, int]] = {quantity: {} for quantity in _INTERFACES}
        for joint, start, names in zip(joints, starts, interfaces, strict=False):
            for quantity, words in _INTERFACES.items():
                word = next((word for word in words if word in names), None)
                if word is not None:
                    at[quantity][joint] = start + names.index(word)
        held = [joint for joint in joints if joint in at["position"]]
        measured = [joint for joint in held if joint in at["effort"]]
        if measured and (silent := [joint for joint in held if joint not in measured]):
            sentence = f"Joints without an effort are left out: {', '.join(silent)}."
            self.notes += [sentence] if sentence not in self.notes else []
        used = measured or held
        columns = [[at[quantity].get(joint, -1) for joint in used] for quantity in _INTERFACES]
        return tuple(used), [[] if -1 in column else column for column in columns]


class DynamicJointStateDecoder(ByField):
    """Messages in bags, see :class:`InterfaceReader`."""

    def __init__(self, definition: Any, kind: str) -> None:
        super().__init__(definition, kind, ("header", "joint_names", "interface_values"), DEFINITION)
        self._interfaces = InterfaceReader()
        self.notes = self._interfaces.notes
        self._bulk = JointStateDecoder(self._bytes_of, self._one)

    @staticmethod
    def suits(kind: str, definition: str) -> bool:
        """Whether a type is this one."""
        return kind.endswith("/DynamicJointState")

    def decode(self, messages: Sequence[bytes], receive_times: Sequence[float]) -> list[JointStateRecord]:
        """As of :class:`ByField`, messages of one kind at once."""
        records = self._bulk.decode(messages, receive_times)
        self.failures, self.last_failure = self._bulk.failures, self._bulk.last_failure
        return records

    def _one(self, message: bytes, receive_time: float) -> JointStateRecord:
        fields = self.reader.read(message)
        stamp = fields["header"].stamp
        return self.record(fields, stamp.sec + 1e-9 * stamp.nanosec, receive_time)

    def _bytes_of(self, message: bytes) -> Layout | None:
        """Where the numbers of messages like this one stand; None where reading them there gives something else."""
        try:
            expected = self._one(message, 0.0)
            key, at = _values_in(message)
            names, index = self._interfaces.layout(key)
        except (ValueError, struct.error):
            return None
        table = np.frombuffer(message, dtype=np.uint8)
        every = np.array(at, dtype=np.intp)[:, None] + np.arange(8)
        fixed = np.setdiff1d(np.arange(len(message)), np.concatenate([every.ravel(), np.arange(4, 12)]))
        layout = Layout(names, tuple(every[some].ravel() for some in index), fixed, table[fixed])
        (found,) = read(table[None], layout, [0.0])
        same = all(np.array_equal(getattr(found, x), getattr(expected, x), equal_nan=True) for x in _INTERFACES)
        return layout if same and found.names == expected.names and found.stamp == expected.stamp else None

    def record(self, fields: Mapping[str, Any], stamp: float, receive_time: float) -> JointStateRecord:
        """The joints with a position; see :class:`ByField`."""
        return self._interfaces.record(fields["joint_names"], fields["interface_values"], stamp, receive_time)


def _values_in(message: bytes) -> tuple[Kind, list[int]]:
    """Joints with the interfaces of each, and where each of all values begins, of a message in little-endian CDR.

    Raises:
        ValueError, struct.error: it is laid out otherwise.
    """
    if message[:2] != b"\x00\x01":
        raise ValueError("not little-endian")
    at = 12  # behind encapsulation and stamp; alignment counts from 4

    def count() -> int:
        nonlocal at
        at += -(at - 4) % 4 + 4
        return int(struct.unpack_from("<I", message, at - 4)[0])

    def text() -> str:
        nonlocal at
        size = count()
        at += size
        return message[at - size : at - 1].decode()

    text()
    key = [tuple(text() for _ in range(count()))]
    values: list[int] = []
    for _ in range(count()):
        key.append(tuple(text() for _ in range(count())))
        size = count()
        at += (-(at - 4) % 8) if size else 0
        if at + 8 * size > len(message):
            raise ValueError("more values than the message has bytes")
        values += range(at, at + 8 * size, 8)
        at += 8 * size
    return tuple(key), values
