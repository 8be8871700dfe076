"""Node ``online_payload_estimator``: estimates what a robot carries, from its joint states and, on legs, its IMU."""

from __future__ import annotations

import gc
import time
from pathlib import Path
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from std_msgs.msg import String

from sysid_ros.nodes import services
from sysid_ros.nodes.diagnostics import NodeState
from sysid_ros.nodes.drawings import PayloadFrame
from sysid_ros.nodes.joint_input import JointInput, Record
from sysid_ros.nodes.messages import LATCHED, Outputs, stamp_of
from sysid_ros.nodes.parameters import NodeParameters, NodeSettings
from sysid_ros.nodes.reporter import Reporter
from sysid_ros.nodes.slow_start import COMPILES, cause_of, said_if_slow
from sysid_ros.nodes.spinning import spin
from sysid_ros.nodes.timing import ReceiveClock, Timing
from sysid_ros.nodes.trunk_inputs import TrunkInputs
from sysid_ros.online.live_estimation import CommitGate, LiveEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.online.warm_up import warm_up
from sysid_ros.online_settings import CommitSettings, OnlineSettings
from sysid_ros.robot.effort_presets import said
from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.sources.source import urdf_text
from sysid_ros.torque.model_file import ModelFile

_SUCCESS, _FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class OnlinePayloadEstimator(LifecycleNode):
    """Reads ``joint_states``, and ``robot_description`` where ``urdf_path`` is empty; of a legged robot ``imu`` and ``contacts``
    too.

    Publishes the payload (:class:`Outputs`) and its own state on ``/diagnostics`` (:class:`Reporter`); services
    ``~/reset``, ``~/tare``, ``~/commit``, ``~/enable``.

    ``configure`` loads the model and names every problem, ``activate`` starts, ``deactivate`` freezes, ``cleanup`` frees. With
    ``autostart`` the first two happen at once.

    Attributes:
        live: the estimation, or None while there is no model.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("online_payload_estimator", **options)
        self.live: LiveEstimation | None = None
        self._state = "unconfigured"
        self._problem = ""
        self._description = ""
        self._troubles: dict[str, int] = {}
        self._trunk_inputs: TrunkInputs | None = None
        self._receive_clock = ReceiveClock()
        self._parameter_source = NodeParameters(self, lambda: self._state != "unconfigured", self._on_parameters)
        self._outputs = Outputs(self)
        drains = self._parameter_source.read(NodeSettings).executor == "single"
        self._joint_states = JointInput(self, self._on_joint_states, drains)
        self._descriptions = self.create_subscription(String, "robot_description", self._on_description, LATCHED)
        services.create(self, self._live_or_refusal, self._publish_committed)
        self._reporter = Reporter(self, self._receive_clock, lambda: self.live, self._state_now, self._outputs.withdraw)
        if self.get_parameter("autostart").value and self.trigger_configure() == _SUCCESS:
            self.trigger_activate()

    @property
    def is_active(self) -> bool:
        """True between activate and deactivate."""
        return self._state == "active"

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._problem = ""
        problems = list(self._parameter_source.problems)
        settings = self._parameter_source.read(NodeSettings)
        urdf, known = self._description, None
        try:
            urdf = urdf_text(settings.urdf_path) if settings.urdf_path else urdf
        except Exception as error:  # noqa: BLE001 - whatever it is, a node that stays unconfigured says why; so below
            problems.append(cause_of(error))
        try:
            known = ModelFile.read(Path(settings.model_path)) if settings.model_path else None
        except Exception as error:  # noqa: BLE001
            problems.append(cause_of(error))
        if settings.publish_tf and self._outputs.frame is None:
            try:
                self._outputs.frame = PayloadFrame(self)
            except ImportError:
                problems.append("publish_tf needs tf2_msgs, which is not installed: sudo apt install ros-jazzy-tf2-msgs.")
        self._known, self._commit = known, CommitGate(self._parameter_source.read(CommitSettings))
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
        self._reporter.timing = Timing()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._state = "inactive"
        self._outputs.withdraw("stale", "The node is inactive.")
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
        self._outputs.withdraw("stale", f"The node is {state}.")
        self.live = None
        self._problem, self._state = "", state
        self._listen_to_trunk(False)
        self._reporter.forget()

    def _listen_to_trunk(self, floats: bool) -> None:
        """Subscribe to IMU and contacts where the robot's base floats."""
        if floats and self._trunk_inputs is None:
            self._trunk_inputs = TrunkInputs(self, self._receive_clock.now, self._take)
        elif not floats and self._trunk_inputs is not None:
            self._trunk_inputs.close()
            self._trunk_inputs = None

    def _load(self, urdf: str) -> str:
        """Make the estimation for a URDF; returns what is wrong, or an empty string."""
        start = time.monotonic()
        try:
            enabled = not self._parameter_source.read(NodeSettings).disabled_at_startup
            live = LiveEstimation(urdf, self._parameter_source.read(OnlineSettings), self._commit, self._known, enabled)
            with said_if_slow(self.get_logger().info, COMPILES):
                warm_up(live.robot, live.settings)
        except Exception as error:  # noqa: BLE001
            return cause_of(error)
        self.live, self._problem = live, ""
        self._listen_to_trunk(live.estimation.base is not None)
        self._commit.interrupt("No estimate yet.")
        self.get_logger().info(
            f"{live.robot.name}: joints {', '.join(live.robot.joint_names)}; payload in {live.estimation.frame}; "
            f"loaded in {time.monotonic() - start:.1f} s"
        )
        for text in said(live.settings.effort_preset):
            self.get_logger().info(text)
        # what lives as long as the node need not be looked through at every collection, which would delay a message
        gc.collect()
        gc.freeze()
        return ""

    def _on_description(self, message: String) -> None:
        if message.data == self._description:
            return
        self._description = message.data
        if self._state not in ("inactive", "active") or self._parameter_source.read(NodeSettings).urdf_path:
            return
        if problem := self._load(message.data):
            self.live = None
            self._problem = f"{problem} A new robot_description will be tried."
            self.get_logger().error(f"{self._descriptions.topic_name}: {self._problem}")

    def _on_joint_states(self, message: Any, record_of: Record) -> None:
        received = time.monotonic() + self._receive_clock.offset
        try:
            record = record_of(message, received)
        except ValueError as error:
            self._trouble(error)
            return
        self._take(record, message.header.stamp if record.stamp else None)
        done = time.monotonic() + self._receive_clock.offset
        self._reporter.timing.messages.append((done - (record.stamp or received), done - received))

    def _take(self, record: JointStateRecord | ImuRecord | ContactRecord, stamp: Any = None) -> None:
        """Estimate, and publish what is due with a stamp, by default that of the estimate."""
        live = self.live
        if live is None or self._state != "active":
            return
        try:
            estimate = live.take(record)
            if estimate is None:
                return
            if self._outputs.joints is not live.robot.joint_names:
                self._outputs.use_joints(live.robot.joint_names, live.settings.joint_names)
            self._outputs.publish(estimate, stamp or stamp_of(estimate.t))
            self._reporter.timing.estimates += 1
            if (committed := live.commit.offer(estimate)) is not None:
                self._publish_committed(committed)
        except Exception as error:  # noqa: BLE001 - one message must not end the node; it is counted and shown
            if not self.context.ok():
                return
            self._trouble(error)

    def _trouble(self, error: Exception) -> None:
        kind = type(error).__name__
        self._troubles[kind] = self._troubles.get(kind, 0) + 1
        self.get_logger().error(f"A message was not handled: {kind}: {error}", throttle_duration_sec=5.0)

    def _live_or_refusal(self) -> LiveEstimation | str:
        if not self.is_active:
            return "The node is not active: run 'ros2 lifecycle set' with activate first."
        return self.live or "There is no robot model yet; see /diagnostics."

    def _publish_committed(self, estimate: PayloadEstimate) -> None:
        self._outputs.publish_committed(estimate, stamp_of(estimate.t))
        what = "no payload" if estimate.is_empty else f"{estimate.mass:.3f} kg"
        self.get_logger().info(f"Committed: {what} (std {estimate.mass_std:.3f} kg).")

    def _on_parameters(self) -> None:
        self._outputs.with_markers = self._parameter_source.read(NodeSettings).publish_markers
        if self._state != "unconfigured":
            self._commit.settings = self._parameter_source.read(CommitSettings)

    def _state_now(self) -> NodeState:
        topic = self._joint_states.topic
        return NodeState(
            state=self._state,
            problem=self._problem,
            topic=topic,
            publishers=self.count_publishers(topic),
            input_problem=self._joint_states.problem,
            troubles=self._troubles,
            published=self._outputs.published,
        )


def main(args: list[str] | None = None) -> int:
    """Run the node until it is asked to stop."""
    return spin(OnlinePayloadEstimator, args)


if __name__ == "__main__":
    raise SystemExit(main())
