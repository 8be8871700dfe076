"""DemoMonitor: listens to the estimator and to the simulated robot, and keeps what both said."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from sysid_ros.inertial_parameters import TO_MESSAGE_ORDER
from sysid_ros.payload_estimate import PayloadEstimate
from sysid_ros.plots import TruthSegment
from sysid_ros.settings import OnlineSettings

ESTIMATOR, ROBOT = "online_payload_estimator", "simulated_robot"
_LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class DemoMonitor(Node):
    """The third process of the demo.

    Attributes:
        estimates: all that the estimator published, its status as the diagnostics told it last.
        truth: what the robot really carried; the last segment goes on.
        joint_names: of the residuals.
        diagnostics: the last values of each diagnostic status by its name.
    """

    def __init__(self) -> None:
        super().__init__("demo_monitor")
        self.estimates: list[PayloadEstimate] = []
        self.truth: list[TruthSegment] = []
        self.joint_names: tuple[str, ...] = ()
        self.diagnostics: dict[str, dict[str, str]] = {}
        self._residual = np.zeros(0)
        self._stamp: float | None = None
        self._frame = ""
        prior = OnlineSettings()
        self._prior_std = np.array([prior.prior_mass_std] + [prior.prior_first_moment_std] * 3 + [prior.prior_inertia_std] * 6)
        # kept as attributes, because rclpy does not keep a subscription alive
        self._listen = (
            self.create_subscription(InertiaStamped, f"{ESTIMATOR}/payload", self._on_payload, 10),
            self.create_subscription(Float64MultiArray, f"{ESTIMATOR}/parameters", self._on_parameters, 10),
            self.create_subscription(JointState, f"{ESTIMATOR}/residual_efforts", self._on_residual, _BEST_EFFORT),
            self.create_subscription(InertiaStamped, f"{ROBOT}/truth", self._on_truth, _LATCHED),
            self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10),
        )

    @property
    def status(self) -> tuple[str, str]:
        """Status of the estimate and the sentence beside it, as the diagnostics told them last."""
        values = self.diagnostics.get(f"{ESTIMATOR}: estimator", {})
        return values.get("status", "warming_up"), values.get("reason", "")
