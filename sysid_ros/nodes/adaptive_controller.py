"""Node ``adaptive_controller``: moves an arm by joint efforts, with a law that knows or learns what the arm carries."""

from __future__ import annotations

import array
import time
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import InertiaStamped
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from sysid_ros.control import ControlSettings
from sysid_ros.control.control_settings import SafetySettings
from sysid_ros.control.live_control import LiveControl
from sysid_ros.control.state_age import StateAge
from sysid_ros.exceptions import SysidError
from sysid_ros.nodes import trajectory_action
from sysid_ros.nodes.controller_messages import MASSLESS, in_order, payload_of, points_of, poll, without_efforts
from sysid_ros.nodes.controller_parts import make_control
from sysid_ros.nodes.controller_settings import ControllerSettings
from sysid_ros.nodes.controller_status import Heard, control_status, idle, input_status
from sysid_ros.nodes.diagnostics import diagnostic_array
from sysid_ros.nodes.messages import LATCHED, inertia_of, record_of, stamp_of
from sysid_ros.nodes.parameters import NodeParameters
from sysid_ros.nodes.payload_inputs import PayloadInputs
from sysid_ros.nodes.slow_start import cause_of
from sysid_ros.nodes.spinning import spin
from sysid_ros.nodes.timing import ReceiveClock
from sysid_ros.robot.inertial_parameters import to_com
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.sources.source import urdf_text

_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
_WATCH, _REPORT, _TELL, _SETTLES, _POLL = 0.005, 1.0, 0.1, 0.3, 0.0005
_LAST_WORDS = 0.02  # the torque of an arm at rest is repeated for so long where no states come
_SUCCESS, _FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class AdaptiveController(LifecycleNode):
    """Reads ``joint_states`` and sends ``effort_commands`` (Float64MultiArray, one effort a joint) for each of them.

    Active, it holds the arm where it stands, and follows what comes on ``~/joint_trajectory`` or by :mod:`.trajectory_action`; an
    empty trajectory or ``~/hold`` brings it to rest. What the arm carries it hears from ``online_payload_estimator``; the laws
    ``slotine_li`` and ``composite`` learn it by themselves too. ``~/reference`` tells the wanted motion with the efforts sent,
    ``~/payload`` what the law believes in, ``/diagnostics`` what is wrong.

    Where joint states stay away the arm is brought to rest on the model alone, and told the torque that holds it; then nothing is
    sent any more, so that the robot's own watch over its commands takes it. Before the node ends, is deactivated or cleaned up it
    brings the arm to rest.

    Attributes: live: the control, None without a model. now: the time that silence is measured by [s].
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("adaptive_controller", **options)
        self.live: LiveControl | None = None
        self._state, self._problem, self._description, self._refusal, self._payload_refusal = "unconfigured", "", "", "", ""
        self.now = time.monotonic
        self._receive_clock, self._state_age, self._old = ReceiveClock(), StateAge(), 0
        groups = (ControllerSettings, ControlSettings, SafetySettings)
        self._parameter_source = NodeParameters(self, lambda: self._state != "unconfigured", lambda: None, groups, ())
        self._commands = self.create_lifecycle_publisher(Float64MultiArray, "effort_commands", 1)
        self._reference = self.create_lifecycle_publisher(JointState, "~/reference", _NEWEST)
        self._payload = self.create_lifecycle_publisher(InertiaStamped, "~/payload", 1)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 1)
        self._states = self.create_subscription(JointState, "joint_states", self._on_joint_states, _NEWEST)
        self._kept = (
            self.create_subscription(String, "robot_description", self._on_description, LATCHED),
            self.create_subscription(JointTrajectory, "~/joint_trajectory", self._on_trajectory, 1),
            PayloadInputs(self, self._on_payload),
            self.create_service(Trigger, "~/hold", self._on_hold),
        )
        self._action = trajectory_action.offer(self, lambda: self.live if self._state == "active" else None)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timers_kept = (
            self.create_timer(_WATCH, self._watch, clock=steady),
            self.create_timer(_REPORT, self._report, clock=steady),
            self.create_timer(_TELL, self._tell, clock=steady),
        )
        if self.get_parameter("autostart").value and self.trigger_configure() == _SUCCESS:
            self.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        problems = list(self._parameter_source.problems)
        settings = self._parameter_source.read(ControllerSettings) if not problems else ControllerSettings()
        self._problem = ""
        if not problems:
            try:
                urdf = urdf_text(settings.urdf_path) if settings.urdf_path else self._description
                if urdf:
                    self._load(urdf, settings)
                else:
                    self._problem = f"Waiting for the URDF on {self.resolve_topic_name('robot_description')}; or set urdf_path."
                    self.get_logger().info(self._problem)
            except Exception as error:  # noqa: BLE001 - whatever it is, a node that stays unconfigured says why
                problems.append(cause_of(error))
        for problem in problems:
            self.get_logger().error(f"Not configured: {problem}")
        if problems:
            self._problem = " ".join(problems)
            return _FAILURE
        self._state = "inactive"
        return _SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._state = "active"
        self._state_age.forget()
        if self.live is not None:
            self.live.forget()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.bring_to_rest()
        self._state = "inactive"
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.bring_to_rest()
        self.live, self._problem, self._state = None, "", "unconfigured"
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.bring_to_rest()
        self.live, self._state = None, "finalized"
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.bring_to_rest()
        self.live, self._state = None, "unconfigured"
        return _SUCCESS

    def bring_to_rest(self) -> None:
        """Brake the arm now, by the states that come while this waits; the last message holds it, as controllers behind the topic
        keep their last command."""
        live = self.live
        if live is None or self._state != "active" or live.reference is None:
            return
        if not live.yields:
            live.hold(at_once=True)
        end = time.monotonic() + live.safety.braking_time + _SETTLES
        while not live.rests and time.monotonic() < end and self.context.ok():
            if (message := poll(self._states)) is not None:
                self._on_joint_states(message)
            else:
                self._watch()
                time.sleep(_POLL)
        self._send_rest()

    def _load(self, urdf: str, settings: ControllerSettings) -> None:
        gains, safety = self._parameter_source.read(ControlSettings), self._parameter_source.read(SafetySettings)
        live, arm, self._gate = make_control(urdf, settings, gains, safety, self.get_logger().info)
        robot, self._arm, self._left_out = arm.robot, arm, float if settings.robot_adds == "nothing" else live.gravity
        self._order = in_order(robot.joint_names, settings.joint_names)
        self._names = [robot.joint_names[j] for j in self._order]
        self.live, self._problem, self._last, self._spoken = live, "", -np.inf, -np.inf
        self.get_logger().info(
            f"{robot.name}: {settings.law} on joints {', '.join(self._names)}; payload in {arm.payload.frame}. Efforts go to "
            f"{self.resolve_topic_name('effort_commands')} while the node is active."
        )
        for sentence in live.law.feedback.notes:
            self.get_logger().warning(sentence)

    def _on_description(self, message: String) -> None:
        self._description = message.data
        settings = self._parameter_source.read(ControllerSettings)
        if self.live is not None or self._state not in ("inactive", "active") or settings.urdf_path:
            return
        try:
            self._load(message.data, settings)
        except Exception as error:  # noqa: BLE001
            self._problem = f"{cause_of(error)} A new robot_description will be tried."
            self.get_logger().error(self._problem)

    def _on_joint_states(self, message: JointState) -> None:
        live = self.live
        if live is None or self._state != "active":
            return
        now = self._receive_clock.now()
        record = without_efforts(record_of(message, now))
        age = self._state_age.of(record.stamp, now)
        self._old += age > live.oldest
        found = self._gate.accept(record) if age < np.inf else None
        if age > live.oldest or not isinstance(found, Measurement) or found.v is None:
            return
        trouble = live.trouble
        try:
            tau = live.command(found.t, found.q, found.v)
            if not live.given_up:
                self._send(tau, message.header.stamp)
            elif not trouble.startswith(live.trouble):
                self._send_rest()
            self._last = self._spoken = self.now()
            live.learn()
        except Exception as error:  # noqa: BLE001 - one state must not end the node; without news the watch holds the arm
            self.get_logger().error(f"A state was not handled: {type(error).__name__}: {error}", throttle_duration_sec=5.0)
        if live.trouble and live.trouble != trouble:
            self.get_logger().error(f"{live.trouble}.")

    def _send(self, tau: FloatArray, stamp: Any) -> None:
        live, efforts = self.live, self._command(tau)
        assert live is not None and live.reference is not None  # noqa: PT018
        wanted = JointState(name=self._names, effort=efforts)
        wanted.header.stamp = stamp
        wanted.position = array.array("d", live.reference.q[self._order].tobytes())
        wanted.velocity = array.array("d", live.reference.v[self._order].tobytes())
        self._reference.publish(wanted)

    def _command(self, tau: FloatArray) -> Any:
        efforts = array.array("d", (tau - self._left_out())[self._order].tobytes())
        self._commands.publish(Float64MultiArray(data=efforts))
        return efforts

    def _send_rest(self) -> None:
        if self.live is not None and self._state == "active" and (tau := self.live.torque_at_rest()) is not None:
            self._command(tau)

    def _watch(self) -> None:
        live = self.live
        if live is None or self._state != "active" or live.given_up:
            return
        silent = self.now() - self._last
        try:
            tau = live.without_states(silent)
        except Exception as error:  # noqa: BLE001 - what holds the arm is left to say
            self.get_logger().error(f"{type(error).__name__} without states: {error}", throttle_duration_sec=5.0)
            tau = None
        if tau is not None:
            self._command(tau)
            self._spoken = self.now()
        elif silent > live.safety.state_timeout and self.now() - self._spoken < _LAST_WORDS:
            self._send_rest()

    def _on_trajectory(self, message: JointTrajectory) -> None:
        live = self.live
        if live is None or self._state != "active":
            self.get_logger().error("A motion was refused: the node is not active or has no model; see /diagnostics.")
            return
        if not message.points:
            live.hold()
            return
        try:
            t, q, v, a = points_of(message)
            live.follow(message.joint_names, t, q, v, a)
        except SysidError as error:
            self._refusal = f"The last motion was refused: {error}"
            self.get_logger().error(self._refusal)
            return
        self._refusal = ""
        self.get_logger().info(f"Following a motion of {len(t)} points and {t[-1]:.2f} s.")

    def _on_payload(self, message: InertiaStamped, covariance: FloatArray | None) -> None:
        try:
            if self.live is not None:
                self.live.tell(payload_of(message, self._arm.payload.frame), covariance)
                self._payload_refusal = ""
        except SysidError as error:
            self._payload_refusal = f"What was told last: {error}"
            self.get_logger().error(str(error), throttle_duration_sec=5.0)

    def _on_hold(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.live is not None and self._state == "active"
        if self.live is not None and response.success:
            self.live.hold()
        response.message = "The arm comes to rest." if response.success else f"The node is {self._state}. {self._problem}".strip()
        return response

    def _tell(self) -> None:
        if self.live is not None and self._state == "active":
            theta, stamp = self.live.law.payload, stamp_of(self._receive_clock.now())
            body = to_com(theta) if theta[0] > MASSLESS else None
            self._payload.publish(inertia_of(body, self._arm.payload.frame, stamp))

    def _report(self) -> None:
        now = 1e-9 * self.get_clock().now().nanoseconds
        self._receive_clock.follow(now)
        robot = self.live.robot.name if self.live is not None else ""
        if self.live is None or self._state != "active":
            statuses = idle(self._state, self._problem)
        else:
            heard = Heard(self.now() - self._last, self._old, f"{self._refusal} {self._payload_refusal}".strip())
            statuses = [input_status(self._gate.health(self._receive_clock.now())), control_status(self.live, heard)]
            self.live.clipped[:], self._old = 0, 0
        self._diagnostics.publish(diagnostic_array(self, now, robot, statuses))


def main(args: list[str] | None = None) -> int:
    """Run the node until it is asked to stop."""
    return spin(AdaptiveController, args)


if __name__ == "__main__":
    raise SystemExit(main())
