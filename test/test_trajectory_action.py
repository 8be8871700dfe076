"""The action ~/follow_joint_trajectory on the real node and a simulated arm; control_msgs and the server are stand-ins."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")
pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install '.[sim]'")

import rclpy
from builtin_interfaces.msg import Duration
from rclpy.action import CancelResponse, GoalResponse
from std_msgs.msg import Header
from test_node_adaptive_controller import Bench
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sysid_ros.nodes import trajectory_action
from sysid_ros.nodes.messages import stamp_of
from sysid_ros.nodes.trajectory_action import TrajectoryAction


class Kind:
    """As much of control_msgs/action/FollowJointTrajectory as the action touches."""

    class Result(SimpleNamespace):
        pass

    class Feedback(SimpleNamespace):
        def __init__(self) -> None:
            super().__init__(header=Header())


class Server:
    """As much of rclpy.action.ActionServer: what comes in goes to the callbacks as it would there."""

    def __init__(self, node: Any, kind: Any, name: str, **callbacks: Any) -> None:
        self.name, self.callbacks = name, callbacks

    def send(self, request: Any) -> Goal:
        goal = Goal(request)
        goal.accepted = self.callbacks["goal_callback"](request) == GoalResponse.ACCEPT
        if goal.accepted:
            self.callbacks["handle_accepted_callback"](goal)
        return goal


class Goal:
    """A goal handle: it has one conclusion, after it was executed."""

    def __init__(self, request: Any) -> None:
        self.request, self.accepted, self.is_cancel_requested = request, False, False
        self.conclusion, self.result = "", SimpleNamespace(error_code=None, error_string="")
        self.feedback: list[Any] = []

    def execute(self, callback: Callable[[Any], Any]) -> None:
        assert not self.conclusion
        self.result = callback(self)
        assert self.conclusion

    def publish_feedback(self, feedback: Any) -> None:
        self.feedback.append(feedback)

    def succeed(self) -> None:
        self.conclusion = "succeeded"

    def abort(self) -> None:
        self.conclusion = "aborted"

    def canceled(self) -> None:
        assert self.is_cancel_requested
        self.conclusion = "canceled"


class Moved:
    """The node on an arm, and who sends goals to it."""

    def __init__(self, folder: Any, name: str, **parameters: Any) -> None:
        self.bench = Bench(folder, name, **parameters)
        node = self.bench.node
        self.action = TrajectoryAction(node, lambda: node.live if node._state == "active" else None, Kind, Server)
        self.server: Any = self.action._server
        self.bench.run(0.1)

    def goal(self, q: np.ndarray, seconds: float = 1.0, **given: Any) -> Goal:
        names = given.pop("names", list(self.bench.arm.robot.joint_names))
        point = JointTrajectoryPoint(positions=[float(x) for x in q])
        point.time_from_start = Duration(sec=int(seconds), nanosec=round(1e9 * (seconds % 1.0)))
        trajectory = JointTrajectory(joint_names=names, points=[point])
        trajectory.header.stamp = given.pop("stamp", stamp_of(0.0))
        empty: dict[str, Any] = {"path_tolerance": [], "goal_tolerance": [], "goal_time_tolerance": Duration()}
        return self.server.send(SimpleNamespace(trajectory=trajectory, **empty | given))  # type: ignore[no-any-return]

    def run(self, seconds: float) -> Any:
        """Motion of the arm, the timer of the action in between."""
        q = None
        for _ in range(round(seconds / 0.02)):
            q = self.bench.run(0.02)[-1]
            self.action.look()
        return q


@pytest.fixture(scope="module", autouse=True)
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture
def moved(tmp_path: Any) -> Iterator[Callable[..., Moved]]:
    made: list[Moved] = []

    def make(name: str, **parameters: Any) -> Moved:
        made.append(Moved(tmp_path, name, **parameters))
        return made[-1]

    yield make
    for one in made:
        one.bench.close()


def tolerance(name: str, position: float) -> SimpleNamespace:
    return SimpleNamespace(name=name, position=position, velocity=0.0, acceleration=0.0)


def test_a_goal_is_followed_told_of_and_succeeds(moved: Callable[..., Moved]) -> None:
    one = moved("goal")
    assert one.server.name == "~/follow_joint_trajectory"
    target = one.bench.centre + 0.2
    names = list(one.bench.arm.robot.joint_names)
    # in another order than the robot's
    goal = one.goal(target[::-1], names=names[::-1], goal_tolerance=[tolerance(names[0], 0.01)])
    assert goal.accepted
    one.run(0.5)
    assert not goal.conclusion
    told = goal.feedback[-1]
    assert list(told.joint_names) == names
    assert np.array(told.desired.positions) - np.array(told.actual.positions) == pytest.approx(np.array(told.error.positions))
    q = one.run(0.7)
    assert (goal.conclusion, goal.result.error_code, goal.result.error_string) == ("succeeded", 0, "")
    assert np.abs(q - target).max() < 2e-3


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({"names": ["a", "b", "c", "d", "e", "f", "g"]}, trajectory_action.INVALID_JOINTS, "it must be of"),
        ({"seconds": 0.001}, trajectory_action.INVALID_GOAL, "a second after"),
        ({"stamp": stamp_of(1000.0)}, trajectory_action.OLD_HEADER_TIMESTAMP, "should have begun"),
    ],
)
def test_a_goal_that_may_not_be_says_why(moved: Callable[..., Moved], change: dict[str, Any], code: int, words: str) -> None:
    one = moved("refuses")
    goal = one.goal(one.bench.centre + 0.5, **change)
    assert goal.accepted
    assert (goal.conclusion, goal.result.error_code) == ("aborted", code)
    assert words in goal.result.error_string
    assert not one.bench.live.following


def test_a_cancelled_goal_brings_the_arm_to_rest(moved: Callable[..., Moved]) -> None:
    one = moved("cancels")
    goal = one.goal(one.bench.centre + 0.5, 2.0)
    one.run(0.6)
    assert one.server.callbacks["cancel_callback"](None) == CancelResponse.ACCEPT
    goal.is_cancel_requested = True
    one.run(0.02)
    assert goal.conclusion == "canceled"
    rest = one.run(0.5)
    assert np.abs(rest - one.bench.centre).max() < 0.4
    assert np.abs(one.run(0.2) - rest).max() < 2e-3


@pytest.mark.parametrize("how", ["goal", "topic", "hold"])
def test_what_takes_the_place_of_a_goal_ends_it(moved: Callable[..., Moved], how: str) -> None:
    one = moved(f"replaced_by_{how}")
    first = one.goal(one.bench.centre + 0.3, 2.0)
    one.run(0.3)
    if how == "goal":
        second = one.goal(one.bench.centre, 2.0)
        assert not second.conclusion
    elif how == "topic":
        one.bench.send([2.0], one.bench.centre[None])
    else:
        assert one.bench.call("hold").success
    one.run(0.02)
    assert first.conclusion == "aborted"
    assert "took its place" in first.result.error_string


def test_an_arm_that_is_held_violates_its_tolerance(moved: Callable[..., Moved]) -> None:
    one = moved("held")
    names = list(one.bench.arm.robot.joint_names)
    goal = one.goal(one.bench.centre + 0.3, 2.0, path_tolerance=[tolerance(names[3], 0.05), tolerance(names[0], -1.0)])
    one.run(0.2)
    before = one.bench.run(0.002)[-1]
    push = np.zeros(7)
    push[3] = 0.1
    one.bench.arm.world.reset(before + push, np.zeros(7))
    one.run(0.02)
    assert (goal.conclusion, goal.result.error_code) == ("aborted", trajectory_action.PATH_VIOLATED)
    assert names[3] in goal.result.error_string


def test_an_arm_that_ends_elsewhere_violates_the_goal_after_its_time(moved: Callable[..., Moved]) -> None:
    one = moved("misses")
    names = list(one.bench.arm.robot.joint_names)
    goal = one.goal(one.bench.centre + 0.1, 0.6, goal_tolerance=[tolerance(name, 1e-9) for name in names])
    one.run(0.8)
    assert (goal.conclusion, goal.result.error_code) == ("aborted", trajectory_action.GOAL_VIOLATED)


def test_an_inactive_node_refuses_and_ends_its_goal(moved: Callable[..., Moved]) -> None:
    one = moved("sleeps")
    goal = one.goal(one.bench.centre + 0.2, 2.0)
    one.run(0.1)
    one.bench.node._state = "inactive"
    one.action.look()
    assert goal.conclusion == "aborted"
    assert not one.goal(one.bench.centre).accepted


def test_without_states_a_goal_does_not_hang(moved: Callable[..., Moved]) -> None:
    one = moved("silent")
    goal = one.goal(one.bench.centre + 0.2, 2.0)
    one.run(0.1)

    def ended() -> str:
        one.action.look()
        return goal.conclusion

    one.bench.until(ended, 5.0)
    assert "No joint states" in goal.result.error_string


def test_the_node_offers_the_action_where_control_msgs_is(moved: Callable[..., Moved]) -> None:
    try:
        import control_msgs.action  # noqa: F401
    except ImportError:
        assert moved("offers").bench.node._action is None
        return
    assert isinstance(moved("offers").bench.node._action, TrajectoryAction)
