"""TrunkOutputs: IMU and foot contacts of the simulated quadruped."""

from __future__ import annotations

import array
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32MultiArray, MultiArrayDimension

from sysid_ros.simulation.quadruped_description import IMU_LINK
from sysid_ros.simulation.quadruped_simulation import QuadrupedState


class TrunkOutputs:
    """Publishes ``imu`` and ``contacts``, reliable and of depth 10 as drivers do.

    Args:
        node: the node.
    """

    def __init__(self, node: Node) -> None:
        self._imu = node.create_publisher(Imu, "imu", 10)
        self._contacts = node.create_publisher(Float32MultiArray, "contacts", 10)
        self._message = Imu()
        self._message.header.frame_id = IMU_LINK
        self._feet = Float32MultiArray()

    def publish(self, state: QuadrupedState, stamp: Any) -> None:
        """Publish what an instant's sensors tell."""
        feet, message = self._feet, self._message
        if not feet.layout.dim:
            size = state.contacts.size
            feet.layout.dim = [MultiArrayDimension(label="foot", size=size, stride=size)]
        feet.data = array.array("f", state.contacts.tolist())
        self._contacts.publish(feet)
        message.header.stamp = stamp
        r, w, f = message.orientation, message.angular_velocity, message.linear_acceleration
        r.x, r.y, r.z, r.w = state.orientation.tolist()
        w.x, w.y, w.z = state.omega.tolist()
        f.x, f.y, f.z = state.specific_force.tolist()
        self._imu.publish(message)
