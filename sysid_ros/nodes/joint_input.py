"""JointInput: joint states of the types that arms publish them in."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState

from sysid_ros.nodes.messages import record_of
from sysid_ros.sample import JointStateRecord
from sysid_ros.sources.dynamic_joint_state import InterfaceReader

_INPUT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
_LOOK_EVERY = 0.5
JOINT_STATE = "sensor_msgs/msg/JointState"
Record = Callable[[Any, float], JointStateRecord]


def dynamic_joint_states(tell: Callable[[str], object]) -> Record:
    """What makes a record of a ``control_msgs/DynamicJointState`` and the time at which it was received [s].

    Args:
        tell: gets a sentence once for what is left out.
    """
    reader = InterfaceReader()

    def record(message: Any, receive_time: float) -> JointStateRecord:
        stamp, known = message.header.stamp, len(reader.notes)
        t = stamp.sec + 1e-9 * stamp.nanosec
        found = reader.record(message.joint_names, message.interface_values, t, receive_time)
        for sentence in reader.notes[known:]:
            tell(sentence)
        return found

    return record


OTHERS: dict[str, Callable[[Callable[[str], object]], Record]] = {"control_msgs/msg/DynamicJointState": dynamic_joint_states}
"""Types beside JointState, and what reads each; their packages need not be installed until somebody publishes one."""


class JointInput:
    """Subscribes to ``joint_states``, in the type that is published there.

    It listens for ``JointState``. Where only another type that it knows is published, it listens for that instead.

    Args:
        node: that subscribes. take: gets each message with what makes its record, ``take(message, record)``. drains: whether all
            messages that wait are taken at once: in the single-threaded executor a wake-up costs more than a message.

    Attributes:
        problem: what keeps messages from being read, with the cure; empty where nothing does.
    """

    def __init__(self, node: Node, take: Callable[[Any, Record], None], drains: bool) -> None:
        self.problem = ""
        self._node, self._take, self._drains = node, take, drains
        self._record: Record = record_of
        self._subscribe(JointState)
        self._timer = node.create_timer(_LOOK_EVERY, self._look)

    @property
    def topic(self) -> str:
        """Its resolved name."""
        return str(self.subscription.topic_name)

    def _subscribe(self, kind: Any) -> None:
        self._kind = kind
        self.subscription = self._node.create_subscription(
            kind,
            "joint_states",
            self._on_many if self._drains else self._on_one,
            _INPUT,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._on_incompatible_qos),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )

    def _look(self) -> None:
        """See in which type joint states are published, until somebody does."""
        kinds = sorted({info.topic_type for info in self._node.get_publishers_info_by_topic(self.topic)})
        if not kinds:
            return
        self._timer.cancel()
        if JOINT_STATE in kinds:
            return
        found = next((kind for kind in kinds if kind in OTHERS), None)
        if found is None:
            self._tell(
                f"{self.topic} is published as {', '.join(kinds)}; joint states are read as {', '.join((JOINT_STATE, *OTHERS))}. "
                "Remap joint_states to a topic of one of these."
            )
            return
        package, _, name = found.split("/")
        try:
            kind = getattr(importlib.import_module(f"{package}.msg"), name)
        except ImportError:
            self._tell(
                f"{self.topic} is published as {found}, and the package {package} is not installed. Install it (apt install "
                f"ros-jazzy-{package.replace('_', '-')}) and start again, or remap joint_states to a topic of {JOINT_STATE}."
            )
            return
        self._node.get_logger().info(f"{self.topic} is published as {found}.")
        self._node.destroy_subscription(self.subscription)
        self._record = OTHERS[found](self._node.get_logger().info)
        self._subscribe(kind)

    def _on_one(self, message: Any) -> None:
        self._take(message, self._record)

    def _on_many(self, message: Any) -> None:
        """The message and all that wait behind it."""
        self._take(message, self._record)
        for _ in range(_INPUT.depth):
            with self.subscription.handle:
                taken = self.subscription.handle.take_message(self._kind, False)
            if taken is None:
                return
            self._take(taken[0], self._record)

    def _on_incompatible_qos(self, event: Any) -> None:
        self._tell(
            f"A publisher on {self.topic} offers less than is asked for (policy {event.last_policy_kind}). "
            "Remove the qos_overrides of the subscription."
        )

    def _tell(self, problem: str) -> None:
        self.problem = problem
        self._node.get_logger().error(problem)
