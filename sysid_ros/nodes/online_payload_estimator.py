"""Node ``online_payload_estimator``: estimates what an arm carries, from its joint states."""

from __future__ import annotations

import gc
import re
import time
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from sysid_ros.commit_gate import CommitGate
from sysid_ros.exceptions import SysidError
from sysid_ros.live_estimation import LiveEstimation
from sysid_ros.model_file import ModelFile
from sysid_ros.nodes import diagnostics, services
from sysid_ros.nodes.messages import RecordReader, stamp_of
from sysid_ros.nodes.outputs import Outputs
from sysid_ros.nodes.parameters import NodeParameters
from sysid_ros.nodes.spinning import spin
from sysid_ros.nodes.timing import ReceiveClock, Timing
from sysid_ros.payload_estimate import PayloadEstimate
from sysid_ros.sources.robot_description import urdf_text
from sysid_ros.warm_up import warm_up

_INPUT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
_LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_DIAGNOSTICS_PERIOD = 1.0
_SUCCESS, _FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class OnlinePayloadEstimator(LifecycleNode):
    """Subscribes ``joint_states`` (and ``robot_description`` where ``urdf_path`` is empty), publishes the payload on ``~/payload``,
    ``~/payload_committed``, ``~/parameters``, ``~/center_of_mass``, ``~/payload_effort``, ``~/residual_efforts``, ``~/markers``, its
    state on ``/diagnostics``; services ``~/reset``, ``~/tare``, ``~/commit``, ``~/enable``.

    ``configure`` loads the model and names every problem, ``activate`` starts, ``deactivate`` freezes, ``cleanup`` frees. With the
    parameter ``autostart`` the first two happen at once.

    Attributes:
        live: the estimation, or None while there is no model.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("online_payload_estimator", **options)
        self.live: LiveEstimation | None = None
        self._state = "unconfigured"
        self._problem = self._qos_problem = ""
        self._description = ""
        self._told: set[str] = set()
        self._troubles: dict[str, int] = {}
        self._read, self._receive_clock, self._timing = RecordReader(), ReceiveClock(), Timing()
        self._parameter_source = NodeParameters(self, lambda: self._state != "unconfigured", self._on_parameters)
        self._outputs = Outputs(self)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", QoSProfile(depth=1))
        self._joint_states = self.create_subscription(
            JointState,
            "joint_states",
            self._on_joint_states,
            _INPUT,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._on_incompatible_qos),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        self._descriptions = self.create_subscription(String, "robot_description", self._on_description, _LATCHED)
        services.create(self)
        # on a steady clock, so that it says what is wrong when ROS time stands still
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self._ticks = self.create_timer(_DIAGNOSTICS_PERIOD, self._on_tick, clock=clock)
        if self.get_parameter("autostart").value and self.trigger_configure() == _SUCCESS:
            self.trigger_activate()

    @property
    def is_active(self) -> bool:
        """True between activate and deactivate."""
        return self._state == "active"

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._problem = ""
        problems = list(self._parameter_source.problems)
        settings = self._parameter_source.node
        urdf, known = self._description, None
        try:
            urdf = urdf_text(settings.urdf_path) if settings.urdf_path else urdf
        except SysidError as error:
            problems.append(str(error))
        try:
            known = ModelFile.read(Path(settings.model_path)) if settings.model_path else None
        except SysidError as error:
            problems.append(str(error))
        self._known, self._commit = known, CommitGate(self._parameter_source.commit)
        self._on_parameters()
        if not problems and urdf and (problem := self._load(urdf)):
            if settings.urdf_path:
                problems.append(problem)
            else:
                self._problem = f"{problem} A new robot_description will be tried."
        for problem in problems:
            self.get_logger().error(f"Not configured: {problem}")
        if problems:
            self._problem = " ".join(problems)
            return _FAILURE
        if not urdf:
            self._problem = f"Waiting for the URDF on {self._descriptions.topic_name}; or set urdf_path."
            self.get_logger().info(self._problem)
        self._state = "inactive"
        return _SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._state = "active"
        self._timing = Timing()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._state = "inactive"
        if self.live is not None:
            self.live.commit.interrupt("The node was inactive.")
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._free("unconfigured")
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._free("finalized")
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._free("unconfigured")
        return _SUCCESS

    def _free(self, state: str) -> None:
        self.live = None
        self._problem, self._state = "", state
        self._told.clear()

    def _load(self, urdf: str) -> str:
        """Make the estimation for a URDF; returns what is wrong, or an empty string."""
        start = time.monotonic()
        try:
            enabled = not self._parameter_source.node.disabled_at_startup
            live = LiveEstimation(urdf, self._parameter_source.online, self._commit, self._known, enabled)
            warm_up(live.robot, live.settings)
        except SysidError as error:
            return str(error)
        self.live, self._problem = live, ""
        self._commit.interrupt("No estimate yet.")
        self.get_logger().info(
            f"{live.robot.name}: joints {', '.join(live.robot.joint_names)}; payload in {live.estimation.frame}; "
            f"loaded in {time.monotonic() - start:.1f} s"
        )
        # what lives as long as the node need not be looked through at every collection, which would delay a message
        gc.collect()
        gc.freeze()
        return ""

    def _on_description(self, message: String) -> None:
        if message.data == self._description:
            return
        self._description = message.data
        if self._state not in ("inactive", "active") or self._parameter_source.node.urdf_path:
            return
        if problem := self._load(message.data):
            self.live = None
            self._problem = f"{problem} A new robot_description will be tried."
            self.get_logger().error(f"{self._descriptions.topic_name}: {self._problem}")

    def _on_joint_states(self, message: JointState) -> None:
        live = self.live
        if live is None or self._state != "active":
            return
        try:
            self._take(live, message)
        except Exception as error:  # noqa: BLE001 - one message must not end the node; it is counted and shown
            kind = type(error).__name__
            self._troubles[kind] = self._troubles.get(kind, 0) + 1
            self.get_logger().error(f"A message was not handled: {kind}: {error}", throttle_duration_sec=5.0)

    def _take(self, live: LiveEstimation, message: JointState) -> None:
        received = self._receive_clock.now()
        record = self._read(message, received)
        estimate = live.take(record)
        done = self._receive_clock.now()
        self._timing.add(done - (record.stamp or received), done - received)
        if estimate is not None:
            self._publish(live, estimate, message.header.stamp if record.stamp else stamp_of(estimate.t))

    def _publish(self, live: LiveEstimation, estimate: PayloadEstimate, stamp: Any) -> None:
        if self._outputs.joints is not live.robot.joint_names:
            self._outputs.use_joints(live.robot.joint_names, live.settings.joint_names)
        self._outputs.publish(estimate, stamp)
        self._timing.estimates += 1
        if (committed := live.offer_commit(estimate)) is not None:
            self.publish_committed(committed)

    def publish_committed(self, estimate: PayloadEstimate) -> None:
        """Publish an estimate that passed the commit gate, and say so."""
        self._outputs.publish_committed(estimate, stamp_of(estimate.t))
        self.get_logger().info(f"Committed {estimate.mass:.3f} kg (std {estimate.mass_std:.3f} kg), status {estimate.status}.")

    def _on_parameters(self) -> None:
        self._outputs.with_markers = self._parameter_source.node.publish_markers
        if self._state != "unconfigured":
            self._commit.settings = self._parameter_source.commit

    def _on_incompatible_qos(self, event: Any) -> None:
        self._qos_problem = (
            f"A publisher on {self._joint_states.topic_name} offers less than is asked for (policy {event.last_policy_kind}). "
            "Remove the qos_overrides of the subscription."
        )
        self.get_logger().error(self._qos_problem)

    def _on_tick(self) -> None:
        now = self._receive_clock.now()
        live = self.live
        health = live.health(now) if live is not None else None
        ros_time = 1e-9 * self.get_clock().now().nanoseconds
        self._receive_clock.follow(ros_time)
        topic = self._joint_states.topic_name
        state = diagnostics.NodeState(
            state=self._state,
            problem=self._problem,
            topic=topic,
            publishers=self.count_publishers(topic),
            clock_problem="" if ros_time > 0.0 else "use_sim_time is set but nobody publishes /clock. Start the simulation, or unset it.",
            qos_problem=self._qos_problem,
            troubles=self._troubles,
        )
        age = health.age if health is not None else float("inf")
        statuses = [
            diagnostics.input_status(state, health if self.is_active else None),
            diagnostics.estimator_status(state, live, age),
            diagnostics.timing_status(self._timing.report(), self._outputs.published),
        ]
        name = live.robot.name if live is not None else ""
        self._diagnostics.publish(diagnostics.diagnostic_array(stamp_of(max(ros_time, 0.0)), name, statuses))
        if live is not None:
            self._tell(live)

    def _tell(self, live: LiveEstimation) -> None:
        """Log each event, each warning and each reason for a rejection once."""
        gate = live.gate
        warnings = [*live.robot.notes, *live.estimation.warnings, *(gate.warnings if gate is not None else ())]
        # a sentence that came before comes again with other numbers
        news = {re.split(r"[\d(:]", sentence)[0]: sentence for sentence in warnings}
        if gate is not None:
            news |= {reason: f"Messages are rejected ({reason}): {gate.last_texts[reason]}" for reason in gate.counts}
        for key in (key for key in news if key not in self._told):
            self._told.add(key)
            self.get_logger().warning(news[key])
        for event in live.estimation.events:
            key = f"event {event.t}"
            if key not in self._told:
                self._told.add(key)
                self.get_logger().info(f"{event.kind} at {event.t:.3f} s: {event.mass_before:.2f} to {event.mass_after:.2f} kg")


def main(args: list[str] | None = None) -> int:
    """Run the node until it is told to stop."""
    return spin(OnlinePayloadEstimator, args)


if __name__ == "__main__":
    raise SystemExit(main())
