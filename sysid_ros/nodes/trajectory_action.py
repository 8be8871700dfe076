"""The action ``~/follow_joint_trajectory`` of the adaptive controller, as MoveIt and others of ros2_control ask for motions."""

from __future__ import annotations

import array
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectoryPoint

from sysid_ros.control.live_control import LiveControl
from sysid_ros.exceptions import SysidError
from sysid_ros.nodes.controller_messages import points_of
from sysid_ros.sample import FloatArray

_LOOK, _FEEDBACK_EVERY = 0.02, 5
_OLD = 0.5
"""A motion that should have begun so long ago is an old one [s]."""
_SILENT = 0.2
"""So long after ``state_timeout`` without a state the arm has been brought to rest without feedback [s]."""
SUCCESSFUL, INVALID_GOAL, INVALID_JOINTS, OLD_HEADER_TIMESTAMP, PATH_VIOLATED, GOAL_VIOLATED = 0, -1, -2, -3, -4, -5
"""Error codes of control_msgs/action/FollowJointTrajectory."""


def offer(node: Node, live: Callable[[], LiveControl | None]) -> TrajectoryAction | None:
    """The action of a node, or None where ``control_msgs`` is not installed; ``live`` gives the control while it is active."""
    try:
        from control_msgs.action import FollowJointTrajectory
    except ImportError:
        node.get_logger().debug("control_msgs is not installed; motions come by ~/joint_trajectory only.")
        return None
    return TrajectoryAction(node, live, FollowJointTrajectory, ActionServer)


class TrajectoryAction:
    """Takes one goal at a time; a newer one, a motion by topic or ``~/hold`` ends the one before.

    A goal that can't be followed is accepted and aborted at once, because only a result can say why. While the motion is under
    way the goal stays in the state *accepted*: it is executed when there is a result, so that no executor waits in a callback.
    Of tolerances the positions are watched.

    Args:
        node: that offers it. live: the control while it is active, else None. kind: FollowJointTrajectory. server: ActionServer.
    """

    def __init__(self, node: Node, live: Callable[[], LiveControl | None], kind: Any, server: Callable[..., Any]) -> None:
        self._node, self._live, self._kind = node, live, kind
        self._goal: Any = None
        self._motion: object = None
        self._path: FloatArray = np.zeros(0)
        self._end: FloatArray = np.zeros(0)
        self._patience, self._arrived, self._looks = 0.0, 0.0, 0
        self._heard: tuple[object, float] = (None, 0.0)
        self._server = server(
            node,
            kind,
            "~/follow_joint_trajectory",
            execute_callback=self._never,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda request: CancelResponse.ACCEPT,
        )
        self._timer = node.create_timer(_LOOK, self.look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _on_goal(self, request: Any) -> Any:
        if self._live() is not None:
            return GoalResponse.ACCEPT
        self._node.get_logger().error("A motion was refused: the node is not active or has no model; see /diagnostics.")
        return GoalResponse.REJECT

    def _on_accepted(self, goal: Any) -> None:
        request, live = goal.request, self._live()
        if self._goal is not None:
            self._finish(PATH_VIOLATED, "Another motion took its place.")
        if live is None:
            self._abort(goal, INVALID_GOAL, "The node is no longer active.")
            return
        try:
            t, q, v, a = points_of(request.trajectory)
            stamp = request.trajectory.header.stamp
            if begin := stamp.sec + 1e-9 * stamp.nanosec:
                late = 1e-9 * self._node.get_clock().now().nanoseconds - begin
                if late > _OLD:
                    self._abort(goal, OLD_HEADER_TIMESTAMP, f"The motion should have begun {late:.2f} s ago; stamp it 0 for now.")
                    return
                t = t + max(-late, 0.0)
            self._path = _limits(request.path_tolerance, live, np.inf)
            self._end = _limits(request.goal_tolerance, live, np.inf)
            live.follow(request.trajectory.joint_names, t, q, v, a)
        except SysidError as error:
            other = sorted(request.trajectory.joint_names) != sorted(live.robot.joint_names)
            self._abort(goal, INVALID_JOINTS if other else INVALID_GOAL, f"The motion was refused: {error}")
            return
        wait = request.goal_time_tolerance
        self._patience = wait.sec + 1e-9 * wait.nanosec
        self._goal, self._motion, self._arrived, self._looks = goal, live.motion, 0.0, 0
        self._heard = (live.error, time.monotonic())
        self._node.get_logger().info(f"Following a motion of {len(t)} points and {t[-1]:.2f} s.")

    def look(self) -> None:
        """See how far the motion is; told by the timer."""
        goal, live = self._goal, self._live()
        if goal is None:
            return
        if live is None:
            self._finish(PATH_VIOLATED, "The node is no longer active.")
        elif goal.is_cancel_requested:
            if live.motion is self._motion:
                live.hold()
            self._finish(SUCCESSFUL, "Cancelled; the arm comes to rest.")
        elif live.motion is not self._motion:
            reason = live.trouble or "Another motion or ~/hold took its place"
            self._finish(PATH_VIOLATED, f"{reason}.")
        elif (far := self._beyond(live, self._path)) and live.following:
            live.hold()
            self._finish(PATH_VIOLATED, f"{far}, more than its path_tolerance; the arm comes to rest.")
        elif self._is_silent(live):
            self._finish(PATH_VIOLATED, "No joint states came any more; the motion was given up.")
        elif not live.following:
            self._look_at_end(live)
        elif self._looks % _FEEDBACK_EVERY == 0:
            self._tell(live)
        self._looks += 1

    def _is_silent(self, live: LiveControl) -> bool:
        """True where no state was answered for a while; each answer has an error of its own."""
        if live.error is not self._heard[0]:
            self._heard = (live.error, time.monotonic())
        return time.monotonic() - self._heard[1] > live.safety.state_timeout + _SILENT

    def _look_at_end(self, live: LiveControl) -> None:
        self._arrived = self._arrived or time.monotonic()
        far = self._beyond(live, self._end)
        if not far:
            self._finish(SUCCESSFUL, "")
        elif time.monotonic() - self._arrived > self._patience:
            self._finish(GOAL_VIOLATED, f"{far}, more than its goal_tolerance.")

    def _beyond(self, live: LiveControl, limits: FloatArray) -> str:
        ratio = np.abs(live.error) / limits
        worst = int(np.argmax(ratio))
        where = live.robot.joint_names[worst]
        return f"{where} is {abs(live.error[worst]):.3f} from where it should be" if ratio[worst] > 1.0 else ""

    def _tell(self, live: LiveControl) -> None:
        wanted = live.reference
        if wanted is None:
            return
        feedback = self._kind.Feedback()
        feedback.header.stamp = self._node.get_clock().now().to_msg()
        feedback.joint_names = list(live.robot.joint_names)
        feedback.desired = _point(positions=wanted.q, velocities=wanted.v, accelerations=wanted.a)
        feedback.actual = _point(positions=wanted.q - live.error)
        feedback.error = _point(positions=live.error)
        self._goal.publish_feedback(feedback)

    def _finish(self, code: int, text: str) -> None:
        goal, self._goal, self._motion = self._goal, None, None
        if goal.is_cancel_requested:
            goal.execute(lambda handle: self._result(handle.canceled, code, text))
        elif code == SUCCESSFUL:
            goal.execute(lambda handle: self._result(handle.succeed, code, text))
        else:
            self._abort(goal, code, text)

    def _abort(self, goal: Any, code: int, text: str) -> None:
        self._node.get_logger().error(text)
        goal.execute(lambda handle: self._result(handle.abort, code, text))

    def _result(self, conclude: Callable[[], None], code: int, text: str) -> Any:
        conclude()
        result = self._kind.Result()
        result.error_code, result.error_string = code, text
        return result

    def _never(self, goal: Any) -> Any:
        """Goals bring what is to be executed along."""
        return self._result(goal.abort, INVALID_GOAL, "The goal was executed by nobody.")


def _limits(tolerances: Any, live: LiveControl, default: float) -> FloatArray:
    """Largest error of each joint, shape (n,): what is given for it, none where that is negative, ``default`` where it is 0."""
    names = live.robot.joint_names
    limits = np.full(len(names), default)
    for tolerance in tolerances:
        if tolerance.name in names and tolerance.position:
            limits[names.index(tolerance.name)] = tolerance.position if tolerance.position > 0.0 else np.inf
    return limits


def _point(**arrays: FloatArray) -> JointTrajectoryPoint:
    return JointTrajectoryPoint(**{name: array.array("d", np.asarray(x).tobytes()) for name, x in arrays.items()})
