"""``control_msgs/DynamicJointState``, which ros2_control's joint_state_broadcaster publishes beside the joint states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.sources.by_field import ByField

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


class DynamicJointStateDecoder(ByField):
    """Each joint with the state interfaces that it has, in any order.

    Resources without a position (sensors, pins) are no joints. Where some joints have efforts, those without (a gripper) are left
    out, which is said; a velocity counts where all joints have one.
    """

    def __init__(self, definition: Any, kind: str) -> None:
        super().__init__(definition, kind, ("header", "joint_names", "interface_values"), DEFINITION)
        self._layouts: dict[Kind, tuple[tuple[str, ...], list[list[int]]]] = {}

    @staticmethod
    def suits(kind: str, definition: str) -> bool:
        """Whether a type is this one."""
        return kind.endswith("/DynamicJointState")

    def record(self, fields: Mapping[str, Any], stamp: float, receive_time: float) -> JointStateRecord:
        """The joints with a position; see :class:`ByField`."""
        parts = fields["interface_values"]
        key = (tuple(fields["joint_names"]), *(tuple(part.interface_names) for part in parts))
        if (layout := self._layouts.get(key)) is None:
            layout = self._layouts[key] = self._layout(key)
        sizes = [len(part.values) for part in parts]
        if sizes != [len(names) for names in key[1:]]:
            raise ValueError(f"a {self.kind} whose values are not as many as its interfaces")
        names, index = layout
        values: FloatArray = np.concatenate([part.values for part in parts]) if parts else np.empty(0)
        q, v, tau = (values[some] for some in index)
        return JointStateRecord(stamp, receive_time, names, q, v, tau)

    def _layout(self, key: Kind) -> tuple[tuple[str, ...], list[list[int]]]:
        """The joints, and where in all values together their positions, velocities and efforts stand."""
        joints, *interfaces = key
        if len(joints) != len(interfaces):
            raise ValueError(f"a {self.kind} with {len(joints)} joints and the interfaces of {len(interfaces)}")
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
