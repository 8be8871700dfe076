"""What a controller hears of the payload from the estimator."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import InertiaStamped
from rclpy.node import Node

from sysid_ros.nodes.messages import LATCHED, body_of

_TOPICS = {"committed": ("payload_committed", LATCHED), "live": ("payload_valid", 1)}
"""What each choice of the parameter ``payload_from`` listens to."""


def payload_inputs(node: Node, hear: Callable[[InertiaStamped], None]) -> tuple[Any, ...]:
    """Subscriptions to what ``online_payload_estimator`` tells; ``hear`` is given what comes from where its ``payload_from``
    says, and is known whole."""
    return tuple(
        node.create_subscription(InertiaStamped, f"online_payload_estimator/{name}", partial(_pass_on, node, hear, source), qos)
        for source, (name, qos) in _TOPICS.items()
    )


def _pass_on(node: Node, hear: Callable[[InertiaStamped], None], source: str, message: InertiaStamped) -> None:
    if node.get_parameter("payload_from").value == source and not is_open(message):
        hear(message)


def is_open(message: InertiaStamped) -> bool:
    """Whether some of it is not known: NaN in the mass, the centre of mass or the inertia."""
    mass, com, tensor = body_of(message)
    return bool(np.isnan(mass) or np.isnan(com).any() or np.isnan(tensor).any())
