"""The real node moves the simulated arm: it holds, follows, learns what is picked up, and stops where something is wrong."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")
pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install '.[sim]'")

os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import InertiaStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sysid_ros.control import Reference
from sysid_ros.control.live_control import LiveControl
from sysid_ros.nodes.adaptive_controller import AdaptiveController
from sysid_ros.nodes.messages import stamp_of
from sysid_ros.nodes.timing import ReceiveClock
from sysid_ros.robot.inertial_parameters import TO_MESSAGE_ORDER, from_com
from sysid_ros.simulation import ArmScenario, ArmSimulation
from sysid_ros.simulation.description import arm_description

RATE = 500
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NAME = "adaptive_controller"


@pytest.fixture(scope="module", autouse=True)
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    yield
    rclpy.try_shutdown()


class Bench:
    """The node, and an arm that waits for its efforts: no time passes for the arm while the node thinks."""

    def __init__(self, folder: Any, namespace: str, **parameters: Any) -> None:
        path = folder / f"{namespace}.urdf"
        path.write_text(arm_description())
        given = {"urdf_path": str(path), "autostart": True, "executor": "single", "loop_delay": 1.0 / RATE} | parameters
        overrides = [Parameter(key, value=value) for key, value in given.items()]
        self.node = AdaptiveController(namespace=namespace, parameter_overrides=overrides)
        self.tester = rclpy.create_node("tester", namespace=namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.tester)
        self.effort: np.ndarray | None = None
        self.adds_gravity = parameters.get("robot_adds", "nothing") != "nothing"
        self.commands = 0
        self.beliefs: list[float] = []
        self.statuses: dict[str, DiagnosticStatus] = {}
        self.states = self.tester.create_publisher(JointState, "joint_states", 1)
        self.motions = self.tester.create_publisher(JointTrajectory, f"{NAME}/joint_trajectory", 1)
        self.payloads = self.tester.create_publisher(InertiaStamped, "online_payload_estimator/payload_committed", LATCHED)
        self.kept = (
            self.tester.create_subscription(Float64MultiArray, "effort_commands", self._on_efforts, 10),
            self.tester.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10),
            self.tester.create_subscription(InertiaStamped, f"{NAME}/payload", lambda m: self.beliefs.append(m.inertia.m), 10),
        )
        self.begin = time.time()
        scenario = ArmScenario(seed=5, duration=60.0, rate=RATE, payload_mass=3.0, pick_time=np.inf)
        self.arm = ArmSimulation(scenario, self._command)
        self.silence = 0.0
        # time is that of the arm: what the machine takes for a step is no silence of the robot
        self.node.now = lambda: self.begin + self.arm.t + self.silence
        self.node._receive_clock = cast("ReceiveClock", SimpleNamespace(now=self.node.now, follow=lambda ros_time: None))
        self.centre = self.arm.trajectory.centre
        self.until(lambda: self.states.get_subscription_count() > 0 and self.motions.get_subscription_count() > 0)
        self.until(lambda: self.node._commands.get_subscription_count() > 0)

    def _command(self, q: np.ndarray, v: np.ndarray, wanted: Reference) -> np.ndarray:
        if self.effort is None:
            still = np.zeros(7)
            return self.arm.own_command(q, v, Reference(self.centre, still, still))
        return self.effort + (self.arm.robot.rnea(q, np.zeros(7), np.zeros(7)) if self.adds_gravity else 0.0)

    def _on_efforts(self, message: Float64MultiArray) -> None:
        self.effort = np.array(message.data)
        self.commands += 1

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.statuses |= {s.name.rpartition(": ")[2]: s for s in message.status}

    @property
    def live(self) -> LiveControl:
        assert self.node.live is not None
        return self.node.live

    def follows(self) -> bool:
        return self.live.following

    def until(self, condition: Callable[[], Any], seconds: float = 30.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"waited in vain; {[(n, s.message) for n, s in self.statuses.items()]}"
            self.executor.spin_once(timeout_sec=0.02)

    def run(self, seconds: float) -> list[np.ndarray]:
        """Let the arm move for so long by its own time; the positions on the way."""
        positions = []
        for _ in range(round(seconds * RATE)):
            told = self.arm.noisy(self.arm.step())
            message = JointState(name=list(self.arm.robot.joint_names), position=told.q, velocity=told.v, effort=told.tau)
            message.header.stamp = stamp_of(self.begin + told.t)
            before = self.commands
            self.states.publish(message)
            self.until(partial(lambda before: self.commands > before, before))
            positions.append(told.q)
        return positions

    def call(self, name: str) -> Any:
        client = self.tester.create_client(Trigger, f"{NAME}/{name}")
        self.until(client.service_is_ready)
        future = client.call_async(Trigger.Request())
        self.until(future.done)
        return future.result()

    def send(self, t: list[float], q: np.ndarray, names: list[str] | None = None, v: np.ndarray | None = None) -> None:
        message = JointTrajectory(joint_names=names or list(self.arm.robot.joint_names))
        for k, time_from_start in enumerate(t):
            point = JointTrajectoryPoint(positions=[float(x) for x in q[k]])
            if v is not None:
                point.velocities = [float(x) for x in v[k]]
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(1e9 * time_from_start), 10**9)
            message.points.append(point)
        self.motions.publish(message)
        for _ in range(20):
            self.executor.spin_once(timeout_sec=0.01)

    def close(self) -> None:
        self.arm.close()
        self.executor.shutdown()
        self.node.destroy_node()
        self.tester.destroy_node()


@pytest.fixture
def bench(tmp_path: Any) -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def make(namespace: str, **parameters: Any) -> Bench:
        made.append(Bench(tmp_path, namespace, **parameters))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.parametrize("law", ["composite", pytest.param("computed_torque", marks=pytest.mark.slow)])
def test_holds_follows_and_learns_what_is_picked_up(bench: Callable[..., Bench], law: str) -> None:
    one = bench(f"moves_{law}", law=law)
    held = one.run(0.3)
    assert np.abs(np.array(held) - one.centre).max() < 2e-3
    goal = one.centre + np.array([0.4, -0.2, 0.3, 0.3, -0.4, 0.2, 0.5])
    one.send([1.0], goal[None])
    assert one.follows()
    arrived = one.run(1.3)[-1]
    assert not one.follows()
    assert np.abs(arrived - goal).max() < 2e-3
    assert one.arm.pick()
    sagged = np.abs(one.run(1.5)[-1] - goal).max()
    if law == "composite":
        assert sagged < 0.03
        assert np.abs(one.run(2.0)[-1] - goal).max() < 0.6 * sagged
        assert one.live.law.payload[0] == pytest.approx(3.0, rel=0.2)
    else:
        assert sagged > 0.06
        assert one.live.law.payload[0] == 0.0


@pytest.mark.parametrize("adds", ["gravity", "gravity_and_friction"])
def test_an_arm_that_adds_gravity_is_sent_efforts_without_it(bench: Callable[..., Bench], adds: str) -> None:
    one = bench(adds, robot_adds=adds)
    goal = one.centre + 0.15
    one.run(0.1)
    one.send(t=[1.0], q=goal[None])
    assert np.abs(one.run(1.5)[-1] - goal).max() < 2e-3
    weight = one.arm.robot.rnea(goal, np.zeros(7), np.zeros(7))
    assert np.abs(weight).max() > 20.0
    assert one.effort is not None
    assert np.abs(one.effort).max() < 2.0


def test_a_committed_payload_is_taken_over(bench: Callable[..., Bench]) -> None:
    one = bench("told", law="certainty_equivalence", payload_from="committed")
    one.run(0.1)
    body = one.arm.payload
    assert body is not None
    message = InertiaStamped()
    message.header.frame_id = one.arm.frame
    message.inertia.m = body.mass
    message.inertia.com.x, message.inertia.com.y, message.inertia.com.z = body.com.tolist()
    tensor: Any = body.inertia_com.tolist()
    (message.inertia.ixx, message.inertia.ixy, message.inertia.ixz) = tensor[0]
    (message.inertia.iyy, message.inertia.iyz, message.inertia.izz) = tensor[1][1], tensor[1][2], tensor[2][2]
    one.payloads.publish(message)
    for _ in range(20):
        one.executor.spin_once(timeout_sec=0.01)
    one.arm.pick()
    one.run(1.5)
    assert one.live.law.payload == pytest.approx(body.theta)
    assert np.abs(one.run(0.01)[-1] - one.centre).max() < 2e-3
    one.until(lambda: one.beliefs and one.beliefs[-1] == pytest.approx(3.0))
    message.header.frame_id = "elsewhere"
    message.inertia.m = 1.0
    one.payloads.publish(message)
    one.run(0.5)
    assert one.live.law.payload == pytest.approx(body.theta)
    one.until(lambda: "elsewhere" in one.statuses.get("controller", DiagnosticStatus()).message)


def test_a_live_value_that_may_not_be_believed_is_not_heard(bench: Callable[..., Bench]) -> None:
    one = bench("hears", law="certainty_equivalence")
    one.run(0.1)
    heard = one.tester.create_publisher(InertiaStamped, "online_payload_estimator/payload_valid", 1)
    one.until(lambda: heard.get_subscription_count() > 0)
    message = InertiaStamped()
    message.header.frame_id = one.arm.frame
    message.inertia.ixx = message.inertia.iyy = message.inertia.izz = 1e-4
    for mass, believed in ((0.05, 0.05), (float("nan"), 0.05), (0.06, 0.06)):
        message.inertia.m = mass
        heard.publish(message)
        for _ in range(20):
            one.executor.spin_once(timeout_sec=0.01)
        one.run(0.5)
        assert one.live.law.payload[0] == pytest.approx(believed)


def test_a_covariance_is_found_by_the_parameters_that_it_is_of(bench: Callable[..., Bench]) -> None:
    one = bench("paired", law="composite")
    heard = one.tester.create_publisher(InertiaStamped, "online_payload_estimator/payload_valid", 1)
    beside = one.tester.create_publisher(Float64MultiArray, "online_payload_estimator/parameters", 10)
    one.until(lambda: min(heard.get_subscription_count(), beside.get_subscription_count()) > 0)
    theta = from_com(1.2, np.array([0.01, 0.02, 0.05]), np.diag([2e-3, 3e-3, 4e-3]))
    covariance = np.diag(np.arange(1.0, 11.0))
    covariance[5, 7] = covariance[7, 5] = 0.5
    order = np.ix_(TO_MESSAGE_ORDER, TO_MESSAGE_ORDER)
    rows = np.vstack([theta[TO_MESSAGE_ORDER], covariance[order]])
    beside.publish(Float64MultiArray(data=rows.ravel().tolist()))
    for _ in range(20):
        one.executor.spin_once(timeout_sec=0.01)
    message = InertiaStamped()
    message.header.frame_id = one.arm.frame
    message.inertia.com.x, message.inertia.com.y, message.inertia.com.z = 0.01, 0.02, 0.05
    message.inertia.ixx, message.inertia.iyy, message.inertia.izz = 2e-3, 3e-3, 4e-3
    assert one.live.refinement is not None
    for mass, found in ((1.2, covariance), (1.3, None)):
        message.inertia.m = mass
        heard.publish(message)
        for _ in range(20):
            one.executor.spin_once(timeout_sec=0.01)
        assert one.live.told.mass in (0.0, pytest.approx(mass))
        if found is None:
            assert one.live.refinement.covariance is None
        else:
            assert one.live.refinement.covariance == pytest.approx(found)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"names": ["a", "b"], "q": np.zeros((1, 2))}, "it must be of lbr_iiwa_joint_1"),
        ({"q": np.full((1, 7), 9.0)}, "the URDF allows"),
        ({"t": [0.001]}, "a second after"),
        ({"t": [0.0, 1.0], "q": np.ones((2, 7))}, "start_tolerance"),
        ({"t": [1.0, 0.5], "q": np.zeros((2, 7))}, "ascend"),
        ({"q": np.full((1, 7), np.nan)}, "not finite"),
        ({"v": np.full((1, 7), 0.3)}, "end at rest"),
        ({"q": np.zeros((1, 6))}, "has 6 positions"),
    ],
    ids=["joints", "range", "speed", "start", "times", "nan", "end", "length"],
)
def test_a_motion_that_may_not_be_is_refused_in_words(bench: Callable[..., Bench], change: dict[str, Any], words: str) -> None:
    one = bench("refuses")
    one.run(0.05)
    sent: dict[str, Any] = {"t": [1.0], "q": one.centre[None] + 0.2} | change
    one.send(**sent)
    assert not one.follows()
    one.run(0.05)
    one.until(lambda: words in one.statuses.get("controller", DiagnosticStatus()).message)
    assert (
        one.statuses["controller"].level == DiagnosticStatus.WARN
        or "No usable joint states" in one.statuses["controller"].message
    )


@pytest.mark.slow
def test_the_arm_comes_to_rest_where_it_is_told_or_pushed_away(bench: Callable[..., Bench]) -> None:
    one = bench("stops", error_limit=0.1)
    one.run(0.05)
    one.send([2.0], one.centre[None] + 0.5)
    one.run(0.6)
    assert one.call("hold").success
    one.run(0.5)
    before = one.run(0.01)[-1]
    assert np.abs(one.run(0.2)[-1] - before).max() < 2e-3
    one.arm.world.reset(before + 0.2, np.zeros(7))
    one.run(0.02)
    assert one.live.yields
    assert "error_limit" in one.live.trouble
    assert np.abs(one.run(0.5)[-1] - before - 0.2).max() < 0.02
    one.send([2.0], one.centre[None])
    assert not one.follows()
    assert one.call("hold").success
    one.send([2.0], one.centre[None])
    assert one.follows()
    assert np.abs(one.run(2.3)[-1] - one.centre).max() < 2e-3


def test_states_that_come_more_slowly_than_the_gains_allow_are_no_loop(bench: Callable[..., Bench]) -> None:
    one = bench("slow", loop_delay=0.001)
    first = one.run(0.3)[0]
    assert one.live.yields
    assert "loop_delay" in one.live.trouble
    assert np.abs(one.run(0.5)[-1] - first).max() < 0.02


def test_without_states_the_last_posture_is_held_without_feedback(bench: Callable[..., Bench]) -> None:
    one = bench("silent")
    q = one.run(0.1)[-1]
    count = one.commands
    one.silence = 0.15
    one.until(lambda: one.commands > count + 3)
    payload = one.node._arm.split(q, *[np.zeros(7)] * 4)[0] @ one.live.law.payload
    assert one.effort == pytest.approx(one.arm.robot.gravity_torque(q) + payload + one.live.unmodelled.mean, abs=0.05)
    one.until(lambda: "controller" in one.statuses and one.statuses["controller"].level == DiagnosticStatus.ERROR)
    assert "without feedback" in one.statuses["controller"].message
    one.silence = 0.0
    assert one.run(0.1)


def test_efforts_keep_within_their_limits(bench: Callable[..., Bench]) -> None:
    one = bench("weak", effort_limit_scale=0.02)
    one.run(0.2)
    assert one.effort is not None
    assert np.all(np.abs(one.effort) <= 0.02 * one.arm.robot.effort_limit + 1e-9)
    assert one.live.clipped.any() or "limit" in one.statuses["controller"].message


def test_nothing_is_sent_before_it_is_activated(bench: Callable[..., Bench]) -> None:
    one = bench("sleeps", autostart=False)
    message = JointState(name=list(one.arm.robot.joint_names), position=one.centre, velocity=[0.0] * 7, effort=[0.0] * 7)
    message.header.stamp = stamp_of(one.begin)
    for _ in range(10):
        one.states.publish(message)
        one.executor.spin_once(timeout_sec=0.02)
    assert one.commands == 0
    assert not one.call("hold").success


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"law": "pid"}, "composite"),
        ({"bandwidth": 0.0}, "bandwidth is 0"),
        ({"urdf_path": "/nowhere.urdf"}, "nowhere.urdf"),
        ({"frame_id": "nowhere"}, "nowhere"),
        ({"gravity": [0.0, 0.0]}, "gravity is (0.0, 0.0); it must be three numbers"),
    ],
)
def test_a_bad_parameter_fails_configure_with_the_reason(
    bench: Callable[..., Bench], parameters: dict[str, Any], words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    one = bench("bad", **parameters)
    assert one.node.live is None
    assert words in one.node._problem
    one.until(lambda: words in one.statuses.get("controller", DiagnosticStatus()).message)
    assert one.statuses["controller"].level == DiagnosticStatus.ERROR
