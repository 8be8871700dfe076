"""FloatingBagSource: joint states, IMU and foot contacts of one bag, in the order in which they were received."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Any

from sysid_ros.exceptions import BagError
from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.sources.bag import BagSource
from sysid_ros.sources.joint_state_cdr import typestore

IMU = "sensor_msgs/msg/Imu"
CONTACTS = ("std_msgs/msg/Float32MultiArray", "std_msgs/msg/Float64MultiArray")
DEFAULT_IMU_TOPIC = "/imu"
DEFAULT_CONTACT_TOPIC = "/contacts"

Record = JointStateRecord | ImuRecord | ContactRecord
_ORDER = {ContactRecord: 0, ImuRecord: 1, JointStateRecord: 2}


class FloatingBagSource:
    """A bag of a legged robot. It can be iterated again.

    Args:
        joints: the bag, with the topic of its joint states chosen.
        imu_topic: where the IMU is; empty: ``/imu``, or the only topic of that type.
        contact_topic: where the foot contacts are; empty: ``/contacts`` where it is in the bag. Without it the stance is
        inferred.

    Attributes:
        imu_topic, contact_topic: that are read; the second is empty where there is none.

    Raises:
        BagError: there is no such topic, or it carries something else.
    """

    def __init__(self, joints: BagSource, imu_topic: str = "", contact_topic: str = "") -> None:
        self._joints = joints
        self.imu_topic = self._chosen_imu(imu_topic)
        self.contact_topic = self._chosen_contacts(contact_topic)

    def __iter__(self) -> Iterator[Record]:
        others = [self._imu()]
        if self.contact_topic:
            others.append(self._contacts())
        return heapq.merge(*others, self._joints, key=lambda record: (record.receive_time, _ORDER[type(record)]))

    def _imu(self) -> Iterator[Record]:
        for time, message in self._messages(self.imu_topic):
            yield ImuRecord.of(message, time)

    def _contacts(self) -> Iterator[Record]:
        for time, message in self._messages(self.contact_topic):
            yield ContactRecord(time, message.data)

    def _messages(self, topic: str) -> Iterator[tuple[float, Any]]:
        deserialize = typestore().deserialize_cdr
        for nanoseconds, data, kind in self._joints.raw_messages(topic):
            try:
                message = deserialize(data, kind)
            except Exception as error:
                raise BagError(
                    f"bag '{self._joints.path}', topic {topic}: a message can't be decoded: {error}. The bag is damaged; "
                    "record it again."
                ) from error
            yield nanoseconds * 1e-9, message

    def _chosen_imu(self, topic: str) -> str:
        there = self._of_kind((IMU,))
        if topic:
            return self._named(topic, there, IMU, "--imu-topic")
        if DEFAULT_IMU_TOPIC in there:
            return DEFAULT_IMU_TOPIC
        if len(there) == 1:
            return there[0]
        found = f"it has {len(there)}: {', '.join(there)}. Choose one with --imu-topic" if there else "it has none. Record it too"
        raise BagError(
            f"bag '{self._joints.path}': a floating base needs a topic of {IMU} with angular velocity and specific force; "
            f"{found}, or set base to 'fixed' if the robot's base does not move."
        )

    def _chosen_contacts(self, topic: str) -> str:
        there = self._of_kind(CONTACTS)
        if topic:
            return self._named(topic, there, " or ".join(CONTACTS), "--contact-topic")
        if DEFAULT_CONTACT_TOPIC in there:
            return DEFAULT_CONTACT_TOPIC
        return ""

    def _of_kind(self, kinds: tuple[str, ...]) -> list[str]:
        return [name for name, (kind, count) in self._joints.topics.items() if kind in kinds and count > 0]

    def _named(self, topic: str, there: list[str], kind: str, option: str) -> str:
        name = topic if topic.startswith("/") else f"/{topic}"
        if name not in there:
            raise BagError(
                f"bag '{self._joints.path}' has no topic {name} with messages of {kind}; it has {', '.join(there) or 'none'}. "
                f"Correct {option}."
            )
        return name
