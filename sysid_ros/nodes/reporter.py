"""Reporter: once a second, the node's state on ``/diagnostics`` and what is new in the log."""

from __future__ import annotations

import re
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile

from sysid_ros.nodes import diagnostics
from sysid_ros.nodes.timing import ReceiveClock, Timing
from sysid_ros.online.live_estimation import LiveEstimation

_PERIOD = 1.0


class Reporter:
    """Publishes three statuses: input, estimator, timing.

    Args:
        node: the node that it reports on.
        receive_clock: gives the age of the input; is brought in line with ROS time here.
        live: the estimation, or None while there is none. state: what the node knows beside it.
        withdraw: is told status and reason when estimates no longer come.

    Attributes:
        timing: collects times for the next report.
    """

    def __init__(
        self,
        node: Node,
        receive_clock: ReceiveClock,
        live: Callable[[], LiveEstimation | None],
        state: Callable[[], diagnostics.NodeState],
        withdraw: Callable[[str, str], None],
    ) -> None:
        self._node, self._clock, self._live, self._state, self._withdraw = node, receive_clock, live, state, withdraw
        self._logged: set[str] = set()
        self.timing = Timing()
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", QoSProfile(depth=1))
        # on a steady clock, so that it says what is wrong when ROS time stands still
        self._timer = node.create_timer(_PERIOD, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def forget(self) -> None:
        """Log everything anew from now on."""
        self._logged.clear()

    def _report(self) -> None:
        live, node = self._live(), self._state()
        health = live.health(self._clock.now()) if live is not None else None
        ros_time = 1e-9 * self._node.get_clock().now().nanoseconds
        self._clock.follow(ros_time)
        statuses = [
            diagnostics.input_status(node, live if node.state == "active" else None, health, ros_time),
            diagnostics.estimator_status(node, live, health.age if health is not None else float("inf")),
            diagnostics.timing_status(self.timing.report(), node.published),
        ]
        robot = live.robot.name if live is not None else ""
        self._publisher.publish(diagnostics.diagnostic_array(self._node, ros_time, robot, statuses))
        if live is not None:
            self._log_news(live)
            self._withdraw_what_is_old(live, health.age if health is not None else float("inf"))

    def _withdraw_what_is_old(self, live: LiveEstimation, age: float) -> None:
        status, reason = live.status(age)
        if status == "stale":
            self._withdraw(status, reason)
        elif not live.enabled:
            self._withdraw("stale", "The estimate is frozen until ~/enable.")

    def _log_news(self, live: LiveEstimation) -> None:
        """Log each event, each warning and each reason for a rejection once."""
        gate, logger = live.gate, self._node.get_logger()
        warnings = [*live.robot.notes, *live.estimation.warnings, *(gate.warnings if gate is not None else ())]
        # a sentence that came before comes again with other numbers
        news = {re.split(r"[\d(:]", sentence)[0]: sentence for sentence in warnings}
        if gate is not None:
            news |= {reason: f"Messages are rejected ({reason}): {gate.last_texts[reason]}" for reason in gate.counts}
        for key in (key for key in news if key not in self._logged):
            self._logged.add(key)
            logger.warning(news[key])
        for event in live.estimation.events:
            key = f"event {event.t}"
            if key not in self._logged:
                self._logged.add(key)
                logger.info(f"{event.kind} at {event.t:.3f} s: {event.mass_before:.2f} to {event.mass_after:.2f} kg")
