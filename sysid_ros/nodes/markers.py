"""The payload as RViz and Foxglove draw it: a box with the same mass and inertia, and a line of text."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from visualization_msgs.msg import Marker, MarkerArray

from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.robot.rotation import equivalent_box, quaternion

_TEXT_HEIGHT = 0.03
_COLOURS = {"ok": (0.2, 0.7, 0.3, 0.6), "not_excited": (0.2, 0.5, 0.8, 0.6)}
_DOUBTFUL = (0.9, 0.6, 0.1, 0.6)


def markers_message(estimate: PayloadEstimate, stamp: Time) -> MarkerArray:
    """Equivalent box and text; both are deleted where nothing is carried."""
    box, text = (Marker(ns="payload", id=i) for i in range(2))
    for marker in (box, text):
        marker.header.stamp, marker.header.frame_id = stamp, estimate.frame
        marker.frame_locked = True
    if estimate.is_empty:
        box.action = text.action = Marker.DELETE
        return MarkerArray(markers=[box, text])
    size, rotation = equivalent_box(estimate.mass, estimate.inertia_com)
    com = estimate.com.tolist()
    box.type, text.type = Marker.CUBE, Marker.TEXT_VIEW_FACING
    for marker, lift in ((box, 0.0), (text, 0.5 * float(size.max()) + _TEXT_HEIGHT)):
        p, c = marker.pose.position, marker.color
        p.x, p.y, p.z = com[0], com[1], com[2] + lift
        marker.pose.orientation.w = 1.0
        c.r, c.g, c.b, c.a = _COLOURS.get(estimate.status, _DOUBTFUL)
    o, s = box.pose.orientation, box.scale
    o.x, o.y, o.z, o.w = quaternion(rotation)
    s.x, s.y, s.z = size.tolist()
    text.scale.z, text.color.a = _TEXT_HEIGHT, 1.0
    text.text = f"{estimate.mass:.2f} kg (std {estimate.mass_std:.2f}) {estimate.status}"
    return MarkerArray(markers=[box, text])
