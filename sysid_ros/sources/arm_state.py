"""States of an arm by its driver's own message: ``franka_msgs/FrankaRobotState``, and ``FrankaState`` before."""

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
_NEXT_TYPE = "====="
"""What stands between a definition and those of the types in it."""


class ArmStateDecoder(ByField):
    """The measured state of an arm, efforts from its link-side torque sensors, gravity in them [N m].

    It stands in ``measured_joint_state``, with names, as in franka_ros2; versions that put the links' names there (panda_link2)
    mean the joints of these numbers. Or it is the arrays ``q``, ``dq`` and ``tau_J``, as before.

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
        self._numbers: tuple[str, ...] = ()

    @staticmethod
    def suits(kind: str, definition: str) -> bool:
        """Whether a type, of which a bag holds a definition, is one of these."""
        own = re.sub(r"(#|//).*", "", definition.split(_NEXT_TYPE, 1)[0])
        words = set(re.findall(r"\w+", own.lower()))
        return _STATE in words or {"q", "tau_j"} <= words

    def _called(self, count: int) -> tuple[str, ...]:
        """What joints are called where the message does not name them."""
        if len(self._numbers) != count:
            self._numbers = tuple(f"joint{k}" for k in range(1, count + 1))
        return self._numbers

    def record(self, fields: Mapping[str, Any], stamp: float, receive_time: float) -> JointStateRecord:
        """The joints; see :class:`ByField`."""
        if not self.names_joints:
            q, v, tau = (_array(fields.get(name, ())) for name in _ARRAYS)
            return JointStateRecord(stamp, receive_time, self._called(len(q)), q, v, tau)
        state = fields[_STATE]
        given = tuple(state.name)
        if (names := self._names.get(given)) is None:
            names = self._names[given] = tuple(re.sub(r"_link(\d+)$", r"_joint\1", name) for name in given)
        q, v, tau = _array(state.position), _array(state.velocity), _array(state.effort)
        return JointStateRecord(stamp, receive_time, names, q, v, tau)


def _array(values: Any) -> FloatArray:
    return np.array(values, dtype=np.float64)
