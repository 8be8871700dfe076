"""DemoMonitor: listens to the estimator and to the simulated robot, and keeps what both said."""

from __future__ import annotations

import math
import os
import time
from dataclasses import replace
from types import TracebackType
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from sysid_ros.nodes.messages import LATCHED, body_of
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.pages import TruthSegment
from sysid_ros.robot.inertial_parameters import TO_MESSAGE_ORDER

ESTIMATOR, ROBOT = "online_payload_estimator", "simulated_robot"
_BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class DemoMonitor(Node):
    """The third process of the demo.

    Attributes:
        estimates: all that the estimator published, its status as of the last diagnostics.
        events: that the estimator found, from the diagnostics.
        truth: what the robot really carried; the last segment goes on without end.
        joint_names: of the residuals.
        diagnostics: the last values of each diagnostic status by its name.
    """

    def __init__(self) -> None:
        super().__init__("demo_monitor")
        self.estimates: list[PayloadEstimate] = []
        self.events: list[PayloadEvent] = []
        self.truth: list[TruthSegment] = []
        self.joint_names: tuple[str, ...] = ()
        self.diagnostics: dict[str, dict[str, str]] = {}
        self._residual = np.zeros(0)
        self._payload: InertiaStamped | None = None
        self._prior_std = OnlineSettings().payload_prior
        # kept as attributes, because rclpy does not keep a subscription alive
        self._listen = (
            self.create_subscription(InertiaStamped, f"{ESTIMATOR}/payload", self._on_payload, 10),
            self.create_subscription(Float64MultiArray, f"{ESTIMATOR}/parameters", self._on_parameters, 10),
            self.create_subscription(JointState, f"{ESTIMATOR}/residual_efforts", self._on_residual, _BEST_EFFORT),
            self.create_subscription(InertiaStamped, f"{ROBOT}/truth", self._on_truth, LATCHED),
            self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10),
        )

    @property
    def status(self) -> tuple[str, str]:
        """Status of the estimate and the sentence beside it, as of the last diagnostics."""
        values = self.diagnostics.get(f"{ESTIMATOR}: estimator", {})
        return values.get("status", "warming_up"), values.get("reason", "")

    @property
    def estimator_is_active(self) -> bool:
        """The estimator has its model and takes messages."""
        return self.diagnostics.get(f"{ESTIMATOR}: estimator", {}).get("state") == "active"

    def truth_until(self, end: float) -> list[TruthSegment]:
        """The truth with an end [s]."""
        return [replace(segment, end=min(segment.end, end)) for segment in self.truth]

    def _on_payload(self, message: InertiaStamped) -> None:
        self._payload = message

    def _on_parameters(self, message: Float64MultiArray) -> None:
        # the estimator publishes ~/payload, which has the stamp, just before ~/parameters, which has all else
        payload, self._payload = self._payload, None
        if payload is None or not self.joint_names:
            return
        table = np.array(message.data).reshape(11, 10)
        covariance = table[1:][np.ix_(TO_MESSAGE_ORDER, TO_MESSAGE_ORDER)]
        status, reason = self._status_of(payload)
        self.estimates.append(
            PayloadEstimate(
                t=_seconds(payload.header.stamp),
                frame=payload.header.frame_id,
                theta=table[0][TO_MESSAGE_ORDER],
                covariance=covariance,
                status=status,
                reason=reason,
                observable=np.sqrt(np.diag(covariance)) < 0.3 * self._prior_std,
                residual=self._residual,
                payload_effort=np.zeros(self._residual.size),
            )
        )

    def _status_of(self, payload: InertiaStamped) -> tuple[str, str]:
        """Status and reason: the diagnostics', which come once a second, and meanwhile what ``~/payload`` shows of them."""
        status, reason = self.status
        if payload.inertia.m == 0.0:
            return ("no_payload", reason if status == "no_payload" else "")
        return ("warming_up", "") if status == "no_payload" else (status, reason)

    def _on_residual(self, message: JointState) -> None:
        self.joint_names, self._residual = tuple(message.name), np.array(message.effort)
        if self.estimates and self.estimates[-1].t == _seconds(message.header.stamp):
            self.estimates[-1] = replace(self.estimates[-1], residual=self._residual)

    def _on_truth(self, message: InertiaStamped) -> None:
        start = _seconds(message.header.stamp)
        if self.truth:
            self.truth[-1] = replace(self.truth[-1], end=start)
        self.truth.append(TruthSegment(start, math.inf, *body_of(message)))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics[status.name] = {pair.key: pair.value for pair in status.values} | {"message": status.message}
        values = self.diagnostics.get(f"{ESTIMATOR}: estimator", {})
        if "last_event" not in values:
            return
        t, before, after = (float(values[f"last_event_{name}"]) for name in ("time", "mass_before", "mass_after"))
        event = PayloadEvent(t, values["last_event"], before, after)
        # the newest event is repeated while its mass is refined
        if self.events and abs(self.events[-1].t - t) < 0.01:
            self.events.pop()
        self.events.append(event)


class Listener:
    """The monitor with ROS around it, so that who uses it needs no rclpy; within ``with``.

    Args:
        environment: ROS variables (``ROS_DOMAIN_ID`` ...) that hold in this process from now on.
    """

    def __init__(self, environment: dict[str, str]) -> None:
        os.environ.update(environment)

    def __enter__(self) -> Listener:
        # the process keeps its own answer to Ctrl-C
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.monitor = DemoMonitor()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.monitor)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._executor.shutdown()
        self.monitor.destroy_node()
        rclpy.try_shutdown()

    def listen(self, seconds: float) -> None:
        """Take in what comes for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)
