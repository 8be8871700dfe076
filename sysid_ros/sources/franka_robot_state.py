"""``franka_msgs/FrankaRobotState`` of franka_ros2, and ``FrankaState`` of it and of franka_ros before."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from sysid_ros.exceptions import BagError
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.sources.by_field import ByField

_STATE = "measured_joint_state"
_ARRAYS = ("q", "dq", "tau_j")
JOINTS = tuple(f"joint{k}" for k in range(1, 8))
"""What joints are called where the message does not name them."""


class FrankaRobotStateDecoder(ByField):
    """The measured state of a Franka arm, efforts from its link-side torque sensors, gravity in them [N m].

    From franka_ros2 1.0 on it stands in ``measured_joint_state``, with names; versions that put the links' names there
    (panda_link2) mean the joints of these numbers. Before, it is the arrays ``q``, ``dq`` and ``tau_J`` of seven.

    Raises:
        BagError: the bag does not define the type, or it holds neither.
    """

    def __init__(self, definition: Any, kind: str) -> None:
        super().__init__(definition, kind, ("header", _STATE, *_ARRAYS))
        there = self.reader.fields
        self.names_joints = _STATE in there
        if "header" not in there or not (self.names_joints or {"q", "tau_j"} <= set(there)):
            raise BagError(
                f"{kind} in this bag has neither a field {_STATE} nor q and tau_J, so it tells nothing of joints. Record "
                "/joint_states too."
            )
        self._names: dict[tuple[str, ...], tuple[str, ...]] = {}

    def record(self, fields: Mapping[str, Any], stamp: float, receive_time: float) -> JointStateRecord:
        """The seven joints; see :class:`ByField`."""
        if not self.names_joints:
            q, v, tau = (_array(fields.get(name, ())) for name in _ARRAYS)
            return JointStateRecord(stamp, receive_time, JOINTS[: len(q)], q, v, tau)
        state = fields[_STATE]
        given = tuple(state.name)
        if (names := self._names.get(given)) is None:
            names = self._names[given] = tuple(re.sub(r"_link(\d+)$", r"_joint\1", name) for name in given)
        q, v, tau = _array(state.position), _array(state.velocity), _array(state.effort)
        return JointStateRecord(stamp, receive_time, names, q, v, tau)


def _array(values: Any) -> FloatArray:
    return np.array(values, dtype=np.float64)
