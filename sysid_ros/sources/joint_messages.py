"""Which types of messages hold joint states, and what reads each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from sysid_ros.sample import JointStateRecord
from sysid_ros.sources.arm_state import ArmStateDecoder
from sysid_ros.sources.dynamic_joint_state import DynamicJointStateDecoder
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


DECODERS: tuple[type[DynamicJointStateDecoder] | type[ArmStateDecoder], ...] = (DynamicJointStateDecoder, ArmStateDecoder)
"""What reads types other than ``sensor_msgs/JointState``; the first that suits does."""


def holds_joints(kind: str, definition: Any) -> bool:
    """Whether messages of a type, such as "sensor_msgs/msg/JointState", hold joint states, by what a bag says of it."""
    return kind == JOINT_STATE or any(each.suits(kind, definition.data) for each in DECODERS)


def decoder_of(kind: str, definition: Any) -> Decoder:
    """What reads the messages of a type.

    Raises:
        BagError: the bag does not define the type, or it has no field that tells of joints.
    """
    suitable = (each for each in DECODERS if each.suits(kind, definition.data))
    return JointStateDecoder() if kind == JOINT_STATE else next(suitable)(definition, kind)
