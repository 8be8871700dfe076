"""What a controller hears of the payload from the estimator."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import InertiaStamped
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from sysid_ros.nodes.messages import LATCHED, body_of
from sysid_ros.robot.inertial_parameters import TO_MESSAGE_ORDER, from_com
from sysid_ros.sample import FloatArray

_TOPICS = {"committed": ("payload_committed", LATCHED), "live": ("payload_valid", 1)}
"""What each choice of the parameter ``payload_from`` listens to."""


_KEPT = 5
"""So many of the newest estimates are kept with their covariance."""
_EQUAL = 1e-6
"""Relative difference up to which two messages hold the same body: they are of one estimate, whatever order they come in."""

Hear = Callable[[InertiaStamped, FloatArray | None], None]


class PayloadInputs:
    """Subscriptions to what ``online_payload_estimator`` tells.

    ``~/payload_valid`` and ``~/payload_committed`` have no covariance. It comes with the same ten parameters on ``~/parameters``,
    and by these it is found.

    Args:
        node: whose parameter ``payload_from`` says what is heard. hear: is given each message that is known whole, and the
            covariance of its ten parameters about the frame's origin, shape (10, 10), None where it is not known.
    """

    def __init__(self, node: Node, hear: Hear) -> None:
        self._node, self._hear = node, hear
        self._newest: deque[FloatArray] = deque(maxlen=_KEPT)
        name = "online_payload_estimator/parameters"
        # made first, as it is published first
        self._kept: list[Any] = [node.create_subscription(Float64MultiArray, name, self._on_parameters, _KEPT)]
        for source, (topic, qos) in _TOPICS.items():
            self._subscribe(source, topic, qos)

    def _subscribe(self, source: str, topic: str, qos: Any) -> None:
        def pass_on(message: InertiaStamped) -> None:
            if self._node.get_parameter("payload_from").value == source and not is_open(message):
                self._hear(message, self._covariance_of(message))

        name = f"online_payload_estimator/{topic}"
        self._kept.append(self._node.create_subscription(InertiaStamped, name, pass_on, qos))

    def _on_parameters(self, message: Float64MultiArray) -> None:
        if len(message.data) == 110:
            self._newest.append(np.reshape(message.data, (11, 10))[:, TO_MESSAGE_ORDER])

    def _covariance_of(self, message: InertiaStamped) -> FloatArray | None:
        mass, com, tensor = body_of(message)
        theta = from_com(mass, com, tensor)
        for rows in reversed(self._newest):
            if np.abs(rows[0] - theta).max() <= _EQUAL * np.abs(theta).max():
                return rows[1:][TO_MESSAGE_ORDER] if np.isfinite(rows).all() else None
        return None


def is_open(message: InertiaStamped) -> bool:
    """Whether some of it is not known: NaN in the mass, the centre of mass or the inertia."""
    mass, com, tensor = body_of(message)
    return bool(np.isnan(mass) or np.isnan(com).any() or np.isnan(tensor).any())
