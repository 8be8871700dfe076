"""TrunkInputs: the topics that only a robot on a floating base has, IMU and foot contacts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32MultiArray, Float64MultiArray

from sysid_ros.sample import ContactRecord, ImuRecord

_INPUT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
_CONTACT_TYPES = {"std_msgs/msg/Float32MultiArray": Float32MultiArray, "std_msgs/msg/Float64MultiArray": Float64MultiArray}
_LOOK_EVERY = 0.5


class TrunkInputs:
    """Subscribes to ``imu`` and, as soon as somebody publishes it, to ``contacts``, whose type is that of the publisher.

    Args:
        node: the node. now: the clock of the receive times [s]. take: what each record goes to.
    """

    def __init__(self, node: Node, now: Callable[[], float], take: Callable[[ImuRecord | ContactRecord], None]) -> None:
        self._node, self._now, self._take = node, now, take
        self._imu = node.create_subscription(Imu, "imu", self._on_imu, _INPUT)
        self._contacts: Any = None
        self._timer = node.create_timer(_LOOK_EVERY, self._look_for_contacts)

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_timer(self._timer)
        for subscription in (self._imu, self._contacts):
            if subscription is not None:
                self._node.destroy_subscription(subscription)

    def _look_for_contacts(self) -> None:
        topic = self._node.resolve_topic_name("contacts")
        kinds = {info.topic_type for info in self._node.get_publishers_info_by_topic(topic)}
        kind = next((kind for name, kind in _CONTACT_TYPES.items() if name in kinds), None)
        if kind is not None:
            self._contacts = self._node.create_subscription(kind, "contacts", self._on_contacts, _INPUT)
            self._timer.cancel()

    def _on_imu(self, message: Imu) -> None:
        self._take(ImuRecord.of(message, self._now()))

    def _on_contacts(self, message: Any) -> None:
        self._take(ContactRecord(self._now(), message.data))
