"""Between messages and values: what comes in as records, and what the node publishes of the payload and when."""

from __future__ import annotations

import array
import time
from collections.abc import Sequence
from operator import methodcaller
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped, PoseWithCovarianceStamped
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout
from visualization_msgs.msg import MarkerArray

from sysid_ros.nodes.believed import Believed, EstimateMessage, inertia_message, is_believed
from sysid_ros.nodes.drawings import PayloadFrame, markers_message
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.robot.inertial_parameters import MESSAGE_NAMES, TO_MESSAGE_ORDER
from sysid_ros.sample import FloatArray, JointStateRecord

_MARKER_PERIOD = 0.2
_LISTENERS = methodcaller("get_subscription_count")
_ORDER = np.ix_(TO_MESSAGE_ORDER, TO_MESSAGE_ORDER)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For what is published once and kept for those who come later."""


def record_of(message: JointState, receive_time: float) -> JointStateRecord:
    """The record of a message that was received at ``receive_time`` [s]."""
    stamp = message.header.stamp
    t = stamp.sec + 1e-9 * stamp.nanosec
    return JointStateRecord(t, receive_time, tuple(message.name), message.position, message.velocity, message.effort)


def stamp_of(t: float) -> Time:
    """A time [s] as a message."""
    sec, nanosec = divmod(round(t * 1e9), 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


def inertia_of(body: tuple[float, FloatArray, FloatArray] | None, frame: str, stamp: Time) -> InertiaStamped:
    """The message of a body's mass, com in the frame and tensor about that, axes parallel to the frame; all zero where there is
    none."""
    message = InertiaStamped()
    message.header.stamp, message.header.frame_id = stamp, frame
    if body is not None:
        inertia, (mass, com, tensor) = message.inertia, body
        inertia.m = mass
        inertia.com.x, inertia.com.y, inertia.com.z = com.tolist()
        (inertia.ixx, inertia.ixy, inertia.ixz), (_, inertia.iyy, inertia.iyz), (_, _, inertia.izz) = tensor.tolist()
    return message


def body_of(message: InertiaStamped) -> tuple[float, FloatArray, FloatArray]:
    """Mass, com and tensor of a message, as of :func:`inertia_of`."""
    i, com = message.inertia, message.inertia.com
    tensor = np.array([[i.ixx, i.ixy, i.ixz], [i.ixy, i.iyy, i.iyz], [i.ixz, i.iyz, i.izz]])
    return i.m, np.array([com.x, com.y, com.z]), tensor


def _reliable(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE)


class Outputs:
    """The publishers of the payload; silent unless the node is active.

    Args:
        node: that they belong to.

    Attributes:
        published: number of estimates. joints: in the model's order, as last published.
        with_markers: whether markers are published while somebody subscribes.
        frame: the payload's frame on /tf, or None where it is not wanted.
    """

    def __init__(self, node: LifecycleNode) -> None:
        best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        create = node.create_lifecycle_publisher
        self._payload = create(InertiaStamped, "~/payload", _reliable(10))
        self._committed = create(InertiaStamped, "~/payload_committed", LATCHED)
        self._parameters = create(Float64MultiArray, "~/parameters", _reliable(10))
        self._com = create(PoseWithCovarianceStamped, "~/center_of_mass", _reliable(10))
        self._effort = create(Float64MultiArray, "~/payload_effort", _reliable(10))
        self._estimate = create(DiagnosticArray, "~/estimate", _reliable(10))
        self._valid = create(InertiaStamped, "~/payload_valid", _reliable(10))
        self._effort_stamped = create(JointState, "~/payload_effort_stamped", _reliable(10))
        self._believed = self._estimate, self._valid, self._effort_stamped
        self._residual = create(JointState, "~/residual_efforts", best_effort)
        self._markers = create(MarkerArray, "~/markers", _reliable(1))
        self._next_markers = 0.0
        self.joints: tuple[str, ...] | None = None
        self._names: list[str] = []
        self._order: Any = None
        self._effort_message, self._residual_message, self._effort_stamped_message = (
            Float64MultiArray(),
            JointState(),
            JointState(),
        )
        self._estimate_message = EstimateMessage()
        self._last: tuple[PayloadEstimate, Time] | None = None
        self.published = 0
        self.with_markers = True
        self.frame: PayloadFrame | None = None

    def use_joints(self, model_order: tuple[str, ...], controller_order: Sequence[str]) -> None:
        """The joints' order in the outputs: the controller's where it names the same joints, else the model's."""
        self.joints = model_order
        same = set(model_order) == set(controller_order)
        self._names = list(controller_order if same else model_order)
        self._order = [list(model_order).index(name) for name in self._names]
        dimension = MultiArrayDimension(label=",".join(self._names), size=len(self._names), stride=len(self._names))
        self._effort_message.layout = MultiArrayLayout(dim=[dimension])
        self._residual_message.name = self._effort_stamped_message.name = self._names

    def publish(self, estimate: PayloadEstimate, stamp: Time) -> None:
        """Publish an estimate with the stamp of its last sample."""
        self._payload.publish(inertia_of(None if estimate.is_empty else estimate.body[:3], estimate.frame, stamp))
        self._parameters.publish(_parameters(estimate))
        self._com.publish(_center_of_mass(estimate, stamp))
        effort = np.zeros(len(self._names)) if estimate.is_empty else estimate.payload_effort[self._order]
        self._effort_message.data = array.array("d", effort.tobytes())
        self._effort.publish(self._effort_message)
        self._residual_message.header.stamp = stamp
        self._residual_message.effort = array.array("d", estimate.residual[self._order].tobytes())
        self._residual.publish(self._residual_message)
        if any(map(_LISTENERS, self._believed)):
            self._publish_believed(estimate, estimate.status, estimate.reason, stamp)
        self._last = estimate, stamp
        if self.frame is not None and is_believed(estimate.status):
            self.frame.publish(estimate, stamp)
        self.published += 1
        now = time.monotonic()
        if self.with_markers and now >= self._next_markers:
            self._next_markers = now + _MARKER_PERIOD
            if self._markers.get_subscription_count() > 0:
                self._markers.publish(markers_message(estimate, stamp))

    def withdraw(self, status: str, reason: str) -> None:
        """Say once of what was published last that it may no longer be believed, and why."""
        if self._last is not None:
            (estimate, stamp), self._last = self._last, None
            self._publish_believed(estimate, status, reason, stamp)

    def _publish_believed(self, estimate: PayloadEstimate, status: str, reason: str, stamp: Time) -> None:
        numbers = Believed.of(estimate, status)
        self._valid.publish(inertia_message(numbers, estimate.frame, stamp))
        effort = np.zeros(len(self._names)) if estimate.is_empty else estimate.payload_effort[self._order]
        self._effort_stamped_message.header.stamp = stamp
        self._effort_stamped_message.effort = array.array("d", (effort if is_believed(status) else effort * np.nan).tobytes())
        self._effort_stamped.publish(self._effort_stamped_message)
        if self._estimate.get_subscription_count() > 0:
            self._estimate.publish(self._estimate_message.of(estimate, status, reason, numbers, stamp))

    def publish_committed(self, estimate: PayloadEstimate, stamp: Time) -> None:
        """Publish an estimate that passed the commit gate."""
        self._committed.publish(inertia_of(None if estimate.is_empty else estimate.body[:3], estimate.frame, stamp))


def _parameters(estimate: PayloadEstimate) -> Float64MultiArray:
    """11 x 10: row 0 the parameters about the frame's origin, rows 1 to 10 their covariance, ordered as the second label says."""
    rows = np.empty((11, 10))
    rows[0] = estimate.theta[TO_MESSAGE_ORDER]
    rows[1:] = estimate.covariance[_ORDER]
    layout = MultiArrayLayout(
        dim=[
            MultiArrayDimension(label="estimate;covariance", size=11, stride=110),
            MultiArrayDimension(label=",".join(MESSAGE_NAMES), size=10, stride=10),
        ]
    )
    return Float64MultiArray(layout=layout, data=array.array("d", rows.tobytes()))


def _center_of_mass(estimate: PayloadEstimate, stamp: Time) -> PoseWithCovarianceStamped:
    """Centre of mass with its covariance; element 0 of the covariance is -1 where nothing is carried (as in sensor_msgs/Imu)."""
    message = PoseWithCovarianceStamped()
    message.header.stamp, message.header.frame_id = stamp, estimate.frame
    pose = message.pose.pose
    pose.orientation.w = 1.0
    covariance = np.zeros((6, 6))
    if estimate.is_empty:
        covariance[0, 0] = -1.0
    else:
        pose.position.x, pose.position.y, pose.position.z = estimate.body.com.tolist()
        covariance[:3, :3] = estimate.body.com_covariance
    message.pose.covariance = covariance.ravel()
    return message
