"""What the node publishes of the payload: topics, their quality of service, and when."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import InertiaStamped, PoseWithCovarianceStamped
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import MarkerArray

from sysid_ros.nodes import messages
from sysid_ros.nodes.markers import markers_message
from sysid_ros.online.payload_estimate import PayloadEstimate

_MARKER_PERIOD = 0.2


def _reliable(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)


class Outputs:
    """The publishers of the payload; silent unless the node is active.

    Args:
        node: that they belong to.

    Attributes:
        published: number of estimates. joints: in the model's order, as last told.
        with_markers: whether markers are published while somebody subscribes.
    """

    def __init__(self, node: LifecycleNode) -> None:
        latched = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        create = node.create_lifecycle_publisher
        self._payload = create(InertiaStamped, "~/payload", _reliable(10))
        self._committed = create(InertiaStamped, "~/payload_committed", latched)
        self._parameters = create(Float64MultiArray, "~/parameters", _reliable(10))
        self._com = create(PoseWithCovarianceStamped, "~/center_of_mass", _reliable(10))
        self._effort = create(Float64MultiArray, "~/payload_effort", _reliable(10))
        self._residual = create(JointState, "~/residual_efforts", best_effort)
        self._markers = create(MarkerArray, "~/markers", _reliable(1))
        self._next_markers = 0.0
        self.joints: tuple[str, ...] | None = None
        self._names: list[str] = []
        self._order: Any = None
        self.published = 0
        self.with_markers = True

    def use_joints(self, model_order: tuple[str, ...], controller_order: Sequence[str]) -> None:
        """The joints' order in the outputs: the controller's where it names the same joints, else the model's."""
        self.joints = model_order
        same = set(model_order) == set(controller_order)
        self._names = list(controller_order if same else model_order)
        self._order = [list(model_order).index(name) for name in self._names]

    def publish(self, estimate: PayloadEstimate, stamp: Time) -> None:
        """Publish an estimate with the stamp of its last sample."""
        self._payload.publish(messages.inertia_message(estimate, stamp))
        self._parameters.publish(messages.parameters_message(estimate))
        self._com.publish(messages.center_of_mass_message(estimate, stamp))
        self._effort.publish(messages.payload_effort_message(estimate, self._order, self._names))
        self._residual.publish(messages.residual_message(estimate, stamp, self._order, self._names))
        self.published += 1
        now = time.monotonic()
        if self.with_markers and now >= self._next_markers:
            self._next_markers = now + _MARKER_PERIOD
            if self._markers.get_subscription_count() > 0:
                self._markers.publish(markers_message(estimate, stamp))

    def publish_committed(self, estimate: PayloadEstimate, stamp: Time) -> None:
        """Publish an estimate that passed the commit gate."""
        self._committed.publish(messages.inertia_message(estimate, stamp))
