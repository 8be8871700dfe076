"""Which types of messages hold joint states, and what reads each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from sysid_ros.sample import JointStateRecord
from sysid_ros.sources.dynamic_joint_state import DynamicJointStateDecoder
from sysid_ros.sources.franka_robot_state import FrankaRobotStateDecoder
from sysid_ros.sources.joint_state_cdr import JOINT_STATE, JointStateDecoder


class Decoder(Protocol):
    """Joint states out of serialised messages, many at once.

    Attributes:
        failures: messages so far that could not be decoded. last_failure: what was wrong with the last. notes: what the user
            should know. names_joints: whether the messages themselves name the joints; else they are the URDF's, in its order.
    """

    failures: int
    last_failure: str
    notes: list[str]
    names_joints: bool

    def decode(self, messages: Sequence[bytes], receive_times: Sequence[float]) -> list[JointStateRecord]:
        """The records of messages, in their order, without those that can't be decoded."""


DECODERS: dict[str, Callable[[Any, str], Decoder]] = {
    "JointState": lambda definition, kind: JointStateDecoder(),
    "DynamicJointState": DynamicJointStateDecoder,
    "FrankaRobotState": FrankaRobotStateDecoder,
    "FrankaState": FrankaRobotStateDecoder,
}
"""What reads a type, by its name without the package: from the definition in the bag and the whole name."""


def holds_joints(kind: str) -> bool:
    """Whether messages of a type, such as "sensor_msgs/msg/JointState", hold joint states."""
    name = kind.rsplit("/", 1)[-1]
    return kind == JOINT_STATE if name == "JointState" else name in DECODERS


def decoder_of(definition: Any, kind: str) -> Decoder:
    """What reads the messages of a type.

    Raises:
        BagError: the bag does not define the type, or it has no field that tells of joints.
    """
    return DECODERS[kind.rsplit("/", 1)[-1]](definition, kind)
