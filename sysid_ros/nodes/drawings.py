"""The payload as it is drawn: markers, and a frame on ``/tf``."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from rclpy.lifecycle import LifecycleNode
from visualization_msgs.msg import Marker, MarkerArray

from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.robot.rotation import equivalent_box, quaternion
from sysid_ros.sample import FloatArray

_TEXT_HEIGHT = 0.03
_POINT = 0.012
_COLOURS = {"ok": (0.2, 0.7, 0.3, 0.6), "not_excited": (0.2, 0.5, 0.8, 0.6)}
_DOUBTFUL = (0.9, 0.6, 0.1, 0.6)
_REGION_COLOUR = (0.8, 0.2, 0.8, 0.3)
_POINT_COLOUR = (0.1, 0.1, 0.1, 1.0)
_REGION = 2.7955
"""Square root of the 95 % quantile of chi-square with three degrees of freedom: axes of the region in standard deviations."""
_LARGEST = 1.0
"""A region that is wider [m] says nothing that can be drawn beside an arm, and is left out."""


def markers_message(estimate: PayloadEstimate, stamp: Time) -> MarkerArray:
    """The payload as RViz and Foxglove draw it: equivalent box, text, centre of mass and its 95 % region, all in the namespace
    ``payload`` and by these ids from 0 on; deleted where nothing is carried."""
    box, text, point, region = markers = [Marker(ns="payload", id=i) for i in range(4)]
    for marker in markers:
        marker.header.stamp, marker.header.frame_id = stamp, estimate.frame
        marker.frame_locked = True
        if estimate.is_empty:
            marker.action = Marker.DELETE
    if estimate.is_empty:
        return MarkerArray(markers=markers)
    size, rotation = equivalent_box(estimate.mass, estimate.inertia_com)
    colour = _COLOURS.get(estimate.status, _DOUBTFUL)
    _place(box, Marker.CUBE, estimate.com, size, rotation, colour)
    _place(point, Marker.SPHERE, estimate.com, np.full(3, _POINT), np.eye(3), _POINT_COLOUR)
    lift = np.array([0.0, 0.0, 0.5 * float(size.max()) + _TEXT_HEIGHT])
    _place(text, Marker.TEXT_VIEW_FACING, estimate.com + lift, np.full(3, _TEXT_HEIGHT), np.eye(3), (*colour[:3], 1.0))
    text.text = f"{estimate.mass:.2f} kg (std {estimate.mass_std:.2f}) {estimate.status}"
    axes, turned = region_of(estimate.body.com_covariance)
    if np.isfinite(axes).all() and float(axes.max()) < _LARGEST:
        _place(region, Marker.SPHERE, estimate.com, axes, turned, _REGION_COLOUR)
    else:
        region.action = Marker.DELETE
    return MarkerArray(markers=markers)


def region_of(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Widths (3,) [m] and rotation (3, 3) of the ellipsoid with 95 % of a normal distribution of this covariance (3, 3)."""
    if not np.isfinite(covariance).all():
        return np.full(3, np.inf), np.eye(3)
    variances, axes = np.linalg.eigh(covariance)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    return 2.0 * _REGION * np.sqrt(np.maximum(variances, 0.0)), axes


def _place(marker: Marker, kind: int, at: FloatArray, size: FloatArray, rotation: FloatArray, colour: tuple[float, ...]) -> None:
    marker.type = kind
    p, o, s, c = marker.pose.position, marker.pose.orientation, marker.scale, marker.color
    p.x, p.y, p.z = at.tolist()
    o.x, o.y, o.z, o.w = quaternion(rotation)
    s.x, s.y, s.z = size.tolist()
    c.r, c.g, c.b, c.a = colour


def transform_of(estimate: PayloadEstimate, stamp: Time) -> TransformStamped:
    """Where the payload's frame is: origin in the centre of mass, axes parallel to the frame that it is expressed in."""
    message = TransformStamped(child_frame_id=f"{estimate.frame}_payload")
    message.header.stamp, message.header.frame_id = stamp, estimate.frame
    t = message.transform.translation
    t.x, t.y, t.z = estimate.com.tolist()
    message.transform.rotation.w = 1.0
    return message


class PayloadFrame:
    """Publishes the frame ``FRAME_payload`` on ``/tf``, a child that nobody else has, so that it meets no robot_state_publisher.

    Args:
        node: that it belongs to.

    Raises:
        ImportError: tf2_msgs is not installed.
    """

    def __init__(self, node: LifecycleNode) -> None:
        from tf2_msgs.msg import TFMessage

        self._message = TFMessage
        self._publisher = node.create_lifecycle_publisher(TFMessage, "/tf", 100)

    def publish(self, estimate: PayloadEstimate, stamp: Time) -> None:
        """Tell where the payload of an estimate is; nothing where nothing is carried."""
        if not estimate.is_empty:
            self._publisher.publish(self._message(transforms=[transform_of(estimate, stamp)]))
