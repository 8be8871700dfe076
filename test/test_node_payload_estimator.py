"""The real node in this process: messages in, messages out."""

from __future__ import annotations

import array
import itertools
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_ros.input_gate import InputGate
from sysid_ros.input_gate.floating_gate import FloatingGate
from sysid_ros.online.live_estimation import LiveEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import InertiaStamped, PoseWithCovarianceStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from sysid_ros.nodes import reporter
from sysid_ros.nodes.messages import stamp_of
from sysid_ros.nodes.online_payload_estimator import OnlinePayloadEstimator
from sysid_ros.robot.inertial_parameters import TO_MESSAGE_ORDER
from sysid_ros.robot.robot_model import RobotModel

ROOT = Path(__file__).resolve().parents[1]
URDF = Path(__file__).parent / "data" / "small_arm.urdf"
ROBOT = RobotModel.from_urdf(URDF.read_text())
NAMES = list(ROBOT.joint_names)
RATE = 250.0
MASS, COM = 1.5, (0.03, -0.02, 0.1)
NODE = "online_payload_estimator"
RELIABLE, BEST_EFFORT = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
_NUMBERS = itertools.count()
VOLATILE, LATCHED = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL
TOPICS = {
    "payload": (InertiaStamped, RELIABLE, VOLATILE, 10),
    "payload_committed": (InertiaStamped, RELIABLE, LATCHED, 1),
    "parameters": (Float64MultiArray, RELIABLE, VOLATILE, 10),
    "center_of_mass": (PoseWithCovarianceStamped, RELIABLE, VOLATILE, 10),
    "payload_effort": (Float64MultiArray, RELIABLE, VOLATILE, 10),
    "estimate": (DiagnosticArray, RELIABLE, VOLATILE, 10),
    "payload_valid": (InertiaStamped, RELIABLE, VOLATILE, 10),
    "payload_effort_stamped": (JointState, RELIABLE, VOLATILE, 10),
    "residual_efforts": (JointState, BEST_EFFORT, VOLATILE, 10),
    "markers": (MarkerArray, RELIABLE, VOLATILE, 1),
}


def motion(duration: float, start: float, mass: float = MASS) -> list[JointState]:
    """Messages of a moving arm that carries a payload."""
    rng = np.random.default_rng(2)
    w = np.linspace(2.1, 4.3, ROBOT.n)
    low, high = np.clip(ROBOT.position_lower, -1.0, 1.0), np.clip(ROBOT.position_upper, -1.0, 1.0)
    swing, frame = 0.4 * (high - low), ROBOT.frame_id(ROBOT.default_frame)
    payload = np.r_[mass, mass * np.array(COM), 0.03, 0.0, 0.03, 0.0, 0.0, 0.02]
    messages = []
    for x in np.arange(round(duration * RATE)) / RATE:
        q = 0.5 * (low + high) + swing * np.sin(w * x)
        v, a = swing * w * np.cos(w * x), -swing * w * w * np.sin(w * x)
        tau = ROBOT.rnea(q, v, a) + ROBOT.payload_regressor(q, v, a, frame) @ payload
        tau += ROBOT.damping * v + ROBOT.friction * np.sign(v) + 0.05 * rng.standard_normal(ROBOT.n)
        message = JointState(name=NAMES, position=q.tolist(), velocity=v.tolist(), effort=tau.tolist())
        message.header.stamp = stamp_of(start + float(x))
        messages.append(message)
    return messages


class Bench:
    """The node and a node that talks to it, in one executor."""

    def __init__(self, urdf: str = str(URDF), **parameters: Any) -> None:
        values = {"urdf_path": urdf} | {name.replace("__", "."): value for name, value in parameters.items()}
        self.namespace = f"arm_{next(_NUMBERS)}"
        self.node = OnlinePayloadEstimator(
            namespace=self.namespace, parameter_overrides=[Parameter(n, value=v) for n, v in values.items()]
        )
        self.tester = rclpy.create_node("tester", namespace=self.namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.tester)
        self.publisher = self.tester.create_publisher(JointState, "joint_states", 10)
        self.heard: dict[str, list[Any]] = {}
        self.sent: list[JointState] = []
        self.kept = [self.listen(topic, *kind) for topic, kind in TOPICS.items() if topic != "payload_committed"]
        self.statuses: dict[str, DiagnosticStatus] = {}
        self.diagnostics = self.tester.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def listen(self, topic: str, kind: Any, reliability: Any, durability: Any, depth: int) -> Any:
        profile = QoSProfile(depth=max(depth, 100), reliability=reliability, durability=durability)
        messages = self.heard.setdefault(topic, [])
        return self.tester.create_subscription(kind, f"{NODE}/{topic}", messages.append, profile)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        prefix = f"{self.namespace}/{NODE}: ".lstrip("/")
        self.statuses |= {s.name.removeprefix(prefix): s for s in message.status if s.name.startswith(prefix)}

    @property
    def live(self) -> LiveEstimation:
        assert self.node.live is not None
        return self.node.live

    @property
    def latest(self) -> PayloadEstimate:
        assert self.live.estimation is not None
        assert self.live.estimation.latest is not None
        return self.live.estimation.latest

    @property
    def gate(self) -> InputGate | FloatingGate:
        assert self.live.gate is not None
        return self.live.gate

    def level(self, name: str) -> bytes | None:
        return self.statuses[name].level if name in self.statuses else None

    def values(self, name: str) -> dict[str, str]:
        return {pair.key: pair.value for pair in self.statuses[name].values} if name in self.statuses else {}

    def until(self, condition: Callable[[], Any], seconds: float = 15.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"waited in vain; {[(n, s.message) for n, s in self.statuses.items()]}"
            self.executor.spin_once(timeout_sec=0.05)

    def settle(self) -> None:
        """Hear what is still on its way: until nothing has come for half a second."""
        quiet, heard = time.monotonic(), -1
        while time.monotonic() < quiet + 0.5:
            if len(self.heard["payload"]) != heard:
                quiet, heard = time.monotonic(), len(self.heard["payload"])
            self.executor.spin_once(timeout_sec=0.05)

    def connect(self) -> None:
        self.until(lambda: self.publisher.get_subscription_count() > 0)

    def send(self, messages: list[JointState]) -> None:
        """Publish, a few at a time, so that the node has read them before the next come."""
        self.connect()
        for k in range(0, len(messages), 20):
            for message in messages[k : k + 20]:
                self.publisher.publish(message)
            gate = self.node.live.gate if self.node.live is not None else None
            wanted = None if gate is None else gate.received + gate.others + len(messages[k : k + 20])
            if wanted is not None and self.node.is_active:
                self.until(partial(lambda gate, wanted: gate.received + gate.others >= wanted, gate, wanted))
            else:
                for _ in range(40):
                    self.executor.spin_once(timeout_sec=0.005)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self.tester.create_client(kind, name if name.startswith("/") else f"{NODE}/{name}")
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        self.tester.destroy_client(client)
        return future.result()

    def trigger(self, name: str) -> tuple[bool, str]:
        response = self.call(Trigger, name, Trigger.Request())
        return response.success, response.message

    def enable(self, data: bool) -> bool:
        return bool(self.call(SetBool, "enable", SetBool.Request(data=data)).success)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.tester.destroy_node()


@pytest.fixture(scope="module", autouse=True)
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reporter, "_PERIOD", 0.1)  # nearly every test waits for what the diagnostics say next
        yield
    rclpy.try_shutdown()


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def make(**arguments: Any) -> Bench:
        made.append(Bench(**arguments))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture(scope="module")
def carrying(ros: None) -> Iterator[Bench]:
    """A node that has seen twelve seconds of an arm with a payload."""
    one = Bench(commit__dwell=0.5, joint_names=list(reversed(NAMES)))
    one.sent = motion(12.0, time.time())
    one.send(one.sent)
    one.until(lambda: one.values("estimator").get("status") == "ok", 3.0)
    for _ in range(40):  # what was published last is on its way
        one.executor.spin_once(timeout_sec=0.005)
    yield one
    one.close()


def test_payload_is_found_and_stamped_with_its_last_sample(carrying: Bench) -> None:
    last = carrying.heard["payload"][-1]
    assert last.inertia.m == pytest.approx(MASS, abs=0.05)
    assert [last.inertia.com.x, last.inertia.com.y, last.inertia.com.z] == pytest.approx(COM, abs=0.02)
    assert last.header.frame_id == ROBOT.default_frame
    assert last.header.stamp in [message.header.stamp for message in carrying.sent]
    assert 12 * 35 < len(carrying.heard["payload"]) < 12 * 60


def test_inertia_is_about_the_centre_of_mass(carrying: Bench) -> None:
    latest, inertia = carrying.latest, carrying.heard["payload"][-1].inertia
    tensor = [[inertia.ixx, inertia.ixy, inertia.ixz], [inertia.ixy, inertia.iyy, inertia.iyz]]
    assert tensor == pytest.approx(latest.inertia_com[:2], rel=1e-6)
    assert inertia.izz == pytest.approx(latest.inertia_com[2, 2], rel=1e-6)


def test_parameters_are_labelled_and_in_the_order_of_the_label(carrying: Bench) -> None:
    message, latest = carrying.heard["parameters"][-1], carrying.latest
    rows, columns = message.layout.dim
    assert (rows.label, rows.size, rows.stride) == ("estimate;covariance", 11, 110)
    assert (columns.label, columns.size, columns.stride) == ("m,mx,my,mz,Ixx,Ixy,Ixz,Iyy,Iyz,Izz", 10, 10)
    data = np.array(message.data).reshape(11, 10)
    assert data[0] == pytest.approx(latest.theta[TO_MESSAGE_ORDER], rel=1e-9)
    assert data[0, 7] == pytest.approx(latest.theta[6])  # Iyy
    assert data[1:] == pytest.approx(latest.covariance[np.ix_(TO_MESSAGE_ORDER, TO_MESSAGE_ORDER)], rel=1e-9)


def test_centre_of_mass_has_its_covariance(carrying: Bench) -> None:
    message, latest = carrying.heard["center_of_mass"][-1], carrying.latest
    covariance = np.array(message.pose.covariance).reshape(6, 6)
    assert covariance[:3, :3] == pytest.approx(latest.body.com_covariance, rel=1e-9)
    assert not covariance[3:].any()
    assert message.pose.pose.orientation.w == 1.0
    assert message.pose.pose.position.z == pytest.approx(latest.com[2])


def test_efforts_stand_in_the_order_of_joint_names(carrying: Bench) -> None:
    latest = carrying.latest
    effort, residual = carrying.heard["payload_effort"][-1], carrying.heard["residual_efforts"][-1]
    assert effort.layout.dim[0].label == ",".join(reversed(NAMES))
    assert list(effort.data) == pytest.approx(latest.payload_effort[::-1].tolist(), rel=1e-9)
    assert list(residual.name) == NAMES[::-1]
    assert list(residual.effort) == pytest.approx(latest.residual[::-1].tolist(), rel=1e-9)
    assert not residual.position


def told(message: DiagnosticArray) -> dict[str, str]:
    """The values of an estimate by their names."""
    (status,) = message.status
    return {pair.key: pair.value for pair in status.values}


def test_no_number_of_a_doubtful_estimate_can_be_taken_for_one(carrying: Bench) -> None:
    kinds = set()
    # the first may have come before its subscriber was known, and what is withdrawn has the stamp of what was published last
    pairs = list(zip(reversed(carrying.heard["estimate"]), reversed(carrying.heard["payload_valid"]), strict=False))
    assert len(pairs) > 400
    for message, valid in pairs:
        assert message.header.stamp == valid.header.stamp
        values, (status,) = told(message), message.status
        believed = values["status"] in ("ok", "no_payload")
        kinds.add(believed)
        assert (status.level == DiagnosticStatus.OK) == believed == (values["valid"] == "1")
        assert message.header.frame_id == valid.header.frame_id == ROBOT.default_frame
        for number in (valid.inertia.m, float(values["mass"]), float(values["parameter.m"])):
            assert np.isfinite(number) == believed
        assert values["status"] in status.message
    assert kinds == {False, True}


def test_the_last_estimate_tells_every_number_under_its_name(carrying: Bench) -> None:
    last = next(m for m in reversed(carrying.heard["estimate"]) if told(m)["valid"] == "1")
    assert last.header.stamp == carrying.heard["payload"][-1].header.stamp
    values = {key: float(value) for key, value in told(last).items() if key != "status"}
    assert values["mass"] == pytest.approx(MASS, abs=0.05)
    assert [values[f"com_{axis}"] for axis in "xyz"] == pytest.approx(COM, abs=0.02)
    assert values["mass_std"] == pytest.approx(values["covariance.m.m"] ** 0.5, rel=1e-6)
    table = np.array(carrying.heard["parameters"][-1].data).reshape(11, 10)
    names = carrying.heard["parameters"][-1].layout.dim[1].label.split(",")
    assert len([key for key in values if key.startswith("covariance.")]) == 55
    assert {key.partition(".")[2] for key in values if key.startswith("parameter.")} == set(names)
    assert values["covariance.mx.Ixy"] == pytest.approx(table[1 + names.index("mx"), names.index("Ixy")], rel=1e-6)


def test_stamped_efforts_are_those_of_their_estimate(carrying: Bench) -> None:
    efforts = carrying.heard["payload_effort_stamped"]
    assert list(efforts[-1].name) == NAMES[::-1]
    for message, valid in zip(efforts, carrying.heard["payload_valid"], strict=True):
        assert message.header.stamp == valid.header.stamp
        assert bool(np.isfinite(message.effort).all()) == np.isfinite(valid.inertia.m)
    finite = [list(m.effort) for m in efforts if np.isfinite(m.effort).all()]
    assert any(list(m.data) == pytest.approx(finite[-1], rel=1e-9) for m in carrying.heard["payload_effort"])


def test_late_joiner_gets_the_committed_payload(carrying: Bench) -> None:
    late = carrying.listen("payload_committed", *TOPICS["payload_committed"])
    carrying.until(lambda: carrying.heard["payload_committed"])
    assert carrying.heard["payload_committed"][-1].inertia.m == pytest.approx(MASS, abs=0.08)
    carrying.tester.destroy_subscription(late)


def test_quality_of_service_is_as_documented(carrying: Bench) -> None:
    for topic, (kind, reliability, durability, _) in TOPICS.items():
        (found,) = carrying.tester.get_publishers_info_by_topic(f"/{carrying.namespace}/{NODE}/{topic}")
        profile = found.qos_profile
        assert (profile.reliability, profile.durability) == (reliability, durability), topic
        assert found.topic_type.endswith(kind.__name__)
    ours = {p.topic_name: p for p in carrying.node.publishers}
    assert {t: ours[f"/{carrying.namespace}/{NODE}/{t}"].qos_profile.depth for t in TOPICS} == {
        t: kind[3] for t, kind in TOPICS.items()
    }
    (subscribed,) = carrying.tester.get_subscriptions_info_by_topic(f"/{carrying.namespace}/joint_states")
    assert (subscribed.qos_profile.reliability, subscribed.qos_profile.durability) == (BEST_EFFORT, VOLATILE)
    assert carrying.node._joint_states.subscription.qos_profile.depth == 100
    assert carrying.node.has_parameter(f"qos_overrides./{carrying.namespace}/joint_states.subscription.depth")


def test_markers_are_drawn_for_who_subscribes(carrying: Bench) -> None:
    box, text, point, region = carrying.heard["markers"][-1].markers
    assert {marker.header.frame_id for marker in (box, text, point, region)} == {ROBOT.default_frame}
    assert min(box.scale.x, box.scale.y, box.scale.z) > 0.0
    assert "1.5" in text.text
    assert [point.pose.position.x, point.pose.position.y, point.pose.position.z] == pytest.approx(COM, abs=0.02)
    assert 0.0 < max(region.scale.x, region.scale.y, region.scale.z) < 0.1


def test_diagnostics_have_three_statuses_with_numbers(carrying: Bench) -> None:
    assert set(carrying.statuses) == {"input", "estimator", "timing"}
    assert {status.hardware_id for status in carrying.statuses.values()} == {ROBOT.name}
    estimator = carrying.values("estimator")
    assert float(estimator["mass"]) == pytest.approx(MASS, abs=0.05)
    assert {"mass_std", "com_x_std", "Ixy_std", "events", "commit", "status", "reason"} <= set(estimator)
    assert {"received", "accepted", "rejected", "rate_hz"} <= set(carrying.values("input"))
    assert {"latency_p50_ms", "step_p99_ms", "load"} <= set(carrying.values("timing"))


def test_becomes_stale_when_messages_stop(carrying: Bench) -> None:
    count = len(carrying.heard["payload"])
    carrying.until(lambda: carrying.values("estimator").get("status") == "stale")
    assert carrying.level("estimator") == DiagnosticStatus.STALE
    assert len(carrying.heard["payload"]) == count
    carrying.until(lambda: told(carrying.heard["estimate"][-1])["status"] == "stale")
    assert np.isnan(carrying.heard["payload_valid"][-1].inertia.m)
    assert np.isnan(carrying.heard["payload_effort_stamped"][-1].effort).all()
    assert carrying.heard["payload_valid"][-1].header.stamp == carrying.heard["payload"][-1].header.stamp
    withdrawn = len(carrying.heard["payload_valid"])
    for _ in range(10):
        carrying.executor.spin_once(timeout_sec=0.05)
    assert len(carrying.heard["payload_valid"]) == withdrawn


@pytest.mark.parametrize("how", ["deactivate", "disable"])
def test_an_estimate_that_is_frozen_is_withdrawn(bench: Callable[..., Bench], how: str) -> None:
    one = bench()
    one.send(motion(3.0, time.time()))
    one.until(lambda: one.heard["estimate"])
    assert one.enable(False) if how == "disable" else one.node.trigger_deactivate() == TransitionCallbackReturn.SUCCESS
    one.until(lambda: told(one.heard["estimate"][-1])["status"] == "stale")
    one.until(lambda: np.isnan(one.heard["payload_valid"][-1].inertia.m))  # of topics of their own either may come first


def test_nan_effort_is_an_error_and_nothing_is_committed(bench: Callable[..., Bench]) -> None:
    one = bench(commit__dwell=0.0)
    committed = one.listen("payload_committed", *TOPICS["payload_committed"])
    messages = motion(2.0, time.time())
    for message in messages:
        message.effort = array.array("d", [float("nan")] * ROBOT.n)
    end = time.monotonic() + 15.0
    while one.level("input") != DiagnosticStatus.ERROR and time.monotonic() < end:
        one.send(messages)
    assert one.level("input") == DiagnosticStatus.ERROR
    assert "NaN" in one.statuses["input"].message
    assert int(one.values("input")["rejected.effort_nan"]) > 0
    assert not one.heard["payload_committed"]
    assert not one.heard["payload"]
    one.tester.destroy_subscription(committed)


@pytest.mark.slow
def test_bag_that_loops_starts_the_estimation_again(bench: Callable[..., Bench]) -> None:
    one = bench()
    messages = motion(4.0, time.time() - 100.0)
    ends = [0]
    for _ in range(3):
        one.send(messages)
        one.settle()
        ends.append(len(one.heard["payload"]))
    assert one.gate.restarts == 2
    learning, second, third = (one.heard["payload"][a:b] for a, b in itertools.pairwise(ends))
    assert second == third  # nothing of the payload is left from the loop before
    assert len(learning) > 0.9 * len(second)  # which learns the source's clock, too
    # each loop ends with a row that is due, in its own phase: within a period of publication and one row of the other
    last = [loop[-1].header.stamp.sec + 1e-9 * loop[-1].header.stamp.nanosec for loop in (learning, second)]
    assert one.node.live is not None
    settings = one.node.live.settings
    row = math.ceil(RATE / settings.update_rate) / RATE
    assert abs(last[0] - last[1]) < 1.0 / settings.publish_rate + row
    one.until(lambda: int(one.values("input").get("restarts", 0)) == 2)


def garbage() -> list[JointState]:
    """One message of each bad kind, between good ones."""
    start = time.time()
    good = motion(1.0, start)
    n, nan = ROBOT.n, float("nan")
    changes: list[dict[str, Any]] = [
        {"effort": [nan] * n},
        {"effort": []},
        {"velocity": []},
        {"velocity": [nan] * n},
        {"position": [nan] * n},
        {"effort": [0.0] * (n - 1)},
        {"position": [0.0] * (n + 3)},
        {"name": []},
        {"name": [NAMES[0]] * n},
        {"name": ["a", "b", "c", "d"]},
        {"name": NAMES[:1], "position": [0.0], "velocity": [0.0], "effort": [0.0]},
        {"name": [*NAMES, "gripper"], "position": [0.0] * (n + 1), "velocity": [0.0] * (n + 1), "effort": [0.0] * (n + 1)},
        {"effort": [1e224] * n},
        {"effort": [float("inf")] * n},
        {"effort": [5e-324] * n},
        {"position": [1e12] * n},
        {"velocity": [-1e9] * n},
        {"effort": [0.0] * n},
        {"name": [], "position": [], "velocity": [], "effort": []},
        {"name": ["\u00e9" * 5000], "position": [0.0]},
    ]
    messages = []
    for k, change in enumerate(changes):
        bad = JointState(name=list(good[k].name), position=good[k].position, velocity=good[k].velocity, effort=good[k].effort)
        bad.header.stamp = stamp_of(start + (k + 0.5) / RATE)
        for name, value in change.items():
            setattr(bad, name, value)
        messages += [good[k], bad]
    for stamp in (stamp_of(0.0), good[30].header.stamp, good[2].header.stamp, stamp_of(1.0), stamp_of(2e9)):
        bad = JointState(name=NAMES, position=good[31].position, velocity=good[31].velocity, effort=good[31].effort)
        bad.header.stamp = stamp
        messages += [good[30], bad]
    return messages


def test_garbage_does_not_stop_the_node(bench: Callable[..., Bench]) -> None:
    one = bench()
    one.send(motion(0.5, time.time() - 10.0))
    one.send(garbage())
    gate = one.gate
    assert len(gate.counts) >= 8
    accepted = gate.accepted
    one.send(motion(3.0, 2.1e9))
    assert gate.accepted - accepted > 700
    assert one.heard["payload"]
    assert not one.live.troubles


def test_fault_in_a_callback_does_not_stop_the_node(bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch) -> None:
    one = bench()
    messages = motion(4.0, time.time())
    one.send(messages[:500])

    def broken(*_: object) -> None:
        raise RuntimeError("made up")

    with monkeypatch.context() as patch:
        patch.setattr(one.node._outputs, "publish", broken)
        one.send(messages[500:600])
    count = len(one.heard["payload"])
    one.send(messages[600:])
    assert len(one.heard["payload"]) > count
    one.until(lambda: "trouble.RuntimeError" in one.values("input"))


def test_whole_numbers_are_taken_for_doubles(bench: Callable[..., Bench]) -> None:
    one = bench(publish_rate=20, gravity=[0, 0, -9], commit__dwell=2)
    assert one.node.live is not None
    assert one.node.live.settings.publish_rate == 20.0
    assert one.node.live.settings.gravity == (0.0, 0.0, -9.0)
    assert one.node.live.commit.settings.dwell == 2.0
    (result,) = one.node.set_parameters([Parameter("commit.dwell", value=3)])
    assert result.successful
    assert one.node.live.commit.settings.dwell == 3.0


def test_unknown_parameter_is_warned_of_by_name(bench: Callable[..., Bench], capfd: pytest.CaptureFixture[str]) -> None:
    bench(cutof_hz=3.0)
    said = capfd.readouterr()
    assert "'cutof_hz'" in said.err + said.out
    assert "cutoff_hz" in said.err + said.out


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("publish_rate", "fast", ("publish_rate", "'fast'", "double")),
        ("publish_rate", -1.0, ("publish_rate", "-1", "0.1 to 1000")),
        ("effort_type", "currents", ("effort_type", "currents", "total, external")),
        ("frame_id", "nowhere", ("nowhere", ROBOT.default_frame)),
        ("joint_names", ["elbow_of_another"], ("elbow_of_another", NAMES[0])),
        ("model_path", "/nowhere/model.yaml", ("/nowhere/model.yaml",)),
        ("urdf_path", "/nowhere/robot.urdf", ("/nowhere/robot.urdf",)),
    ],
)
def test_bad_value_fails_configure_with_the_reason(
    bench: Callable[..., Bench], capfd: pytest.CaptureFixture[str], name: str, value: Any, words: tuple[str, ...]
) -> None:
    one = bench(**{name: value}) if name != "urdf_path" else bench(urdf=value)
    assert one.node.live is None
    assert one.node.trigger_configure() == TransitionCallbackReturn.FAILURE
    said = capfd.readouterr().err
    assert all(word in said for word in words), said
    one.until(lambda: one.level("estimator") == DiagnosticStatus.ERROR)
    assert words[0] in one.statuses["estimator"].message


def test_corrected_value_can_be_configured(bench: Callable[..., Bench]) -> None:
    one = bench(publish_rate=-1.0)
    (refused,) = one.node.set_parameters([Parameter("publish_rate", value=1e6)])
    assert not refused.successful
    assert "publish_rate" in refused.reason
    assert "1000" in refused.reason
    assert one.node.set_parameters([Parameter("publish_rate", value=20.0)])[0].successful
    assert one.node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    (refused,) = one.node.set_parameters([Parameter("publish_rate", value=30.0)])
    assert "unconfigured" in refused.reason


def test_parameters_are_declared_with_type_range_and_unit(bench: Callable[..., Bench]) -> None:
    node = bench(autostart=False).node
    described = node.describe_parameter("sensor_timeout")
    assert described.type == Parameter.Type.DOUBLE.value
    assert (described.floating_point_range[0].from_value, described.floating_point_range[0].to_value) == (0.01, 60.0)
    assert "[s]" in described.description
    assert node.describe_parameter("joint_names").type == Parameter.Type.STRING_ARRAY.value


def test_lifecycle(bench: Callable[..., Bench]) -> None:
    one = bench(autostart=False)
    node, success = one.node, TransitionCallbackReturn.SUCCESS
    assert (node.live, node.is_active) == (None, False)
    assert node.trigger_configure() == success
    start = time.time()
    messages = motion(6.0, start)
    assert one.trigger("reset") == (False, one.trigger("reset")[1])
    one.connect()
    for message in messages[:50]:
        one.publisher.publish(message)
    one.until(lambda: one.level("input") == DiagnosticStatus.STALE)
    assert one.live.gate is None
    assert node.trigger_activate() == success
    one.send(messages[50:800])
    assert one.heard["payload"]
    frozen, count = one.live.estimation.latest, len(one.heard["payload"])
    assert node.trigger_deactivate() == success
    for message in messages[800:900]:
        one.publisher.publish(message)
    for _ in range(150):
        one.executor.spin_once(timeout_sec=0.005)
    assert one.live.estimation.latest is frozen
    assert node.trigger_activate() == success
    one.send(messages[900:])
    assert len(one.heard["payload"]) > count
    assert node.trigger_deactivate() == success
    assert node.trigger_cleanup() == success
    assert node.live is None
    assert node.trigger_configure() == success
    assert node.trigger_shutdown() == success


def test_services(bench: Callable[..., Bench]) -> None:
    one = bench()
    start = time.time()
    messages = motion(14.0, start)
    assert not one.trigger("tare")[0]
    assert not one.trigger("commit")[0]
    one.send(messages[:2500])
    committed = one.listen("payload_committed", *TOPICS["payload_committed"])
    done, sentence = one.trigger("commit")
    assert done, sentence
    one.until(lambda: one.heard["payload_committed"])
    assert one.enable(False)
    count = len(one.heard["payload"])
    one.send(messages[2500:2700])
    assert len(one.heard["payload"]) == count
    assert one.enable(True)
    one.send(messages[2700:2900])
    assert len(one.heard["payload"]) > count
    assert one.trigger("tare")[0]
    one.send(messages[2900:3300])
    assert one.heard["payload"][-1].inertia.m == pytest.approx(0.0, abs=0.15)
    assert one.trigger("reset")[0]
    assert one.live.estimation.latest is None
    one.tester.destroy_subscription(committed)


def test_starts_disabled_when_told_so(bench: Callable[..., Bench]) -> None:
    one = bench(disabled_at_startup=True)
    one.send(motion(2.0, time.time()))
    assert not one.heard["payload"]
    one.until(lambda: one.values("estimator").get("enabled") == "False")
    assert one.level("estimator") != DiagnosticStatus.OK


def test_urdf_by_topic_and_after_a_bad_one(bench: Callable[..., Bench]) -> None:
    one = bench(urdf="")
    one.until(lambda: "robot_description" in one.statuses.get("estimator", DiagnosticStatus()).message)
    profile = QoSProfile(depth=1, reliability=RELIABLE, durability=LATCHED)
    description = one.tester.create_publisher(String, "robot_description", profile)
    description.publish(String(data="<robot name='broken'"))
    one.until(lambda: "XML" in one.statuses["estimator"].message)
    assert one.node.live is None
    description.publish(String(data=URDF.read_text()))
    one.until(lambda: one.node.live is not None)
    one.send(motion(2.0, time.time()))
    assert one.heard["payload"]


def test_joints_that_no_message_names_are_locked(bench: Callable[..., Bench]) -> None:
    one = bench()
    messages = motion(2.0, time.time())
    for message in messages:
        for name in ("name", "position", "velocity", "effort"):
            setattr(message, name, getattr(message, name)[:3])
    one.connect()
    for message in messages[:5]:
        one.publisher.publish(message)
    one.until(lambda: (one.publisher.publish(messages[5]), one.live.gate is not None)[1])
    assert one.live.robot.joint_names == tuple(NAMES[:3])


def test_simulated_time_without_a_clock_is_an_error(bench: Callable[..., Bench]) -> None:
    one = bench(use_sim_time=True)
    one.until(lambda: one.level("input") == DiagnosticStatus.ERROR)
    assert "/clock" in one.statuses["input"].message


def test_no_publisher_is_said_by_topic(bench: Callable[..., Bench]) -> None:
    one = bench()
    one.tester.destroy_publisher(one.publisher)
    one.until(lambda: one.level("input") == DiagnosticStatus.STALE)
    assert "/joint_states; publishers: 0" in one.statuses["input"].message


@pytest.mark.parametrize("executor", ["events", pytest.param("single", marks=pytest.mark.slow)])
def test_process_answers_and_ends_cleanly_on_interrupt(executor: str, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sysid_ros.nodes.online_payload_estimator", "--ros-args", "-p", f"urdf_path:={URDF}"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(tmp_path), "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        [*command, "-p", f"executor:={executor}"],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    try:
        assert "payload in" in process.stdout.readline()
        one = Bench(urdf="", autostart=False)
        one.namespace = ""
        try:
            one.until(lambda: one.level("timing") is not None)
            assert one.call(Trigger, f"/{NODE}/reset", Trigger.Request()).success
            request = ChangeState.Request()
            request.transition.id = Transition.TRANSITION_DEACTIVATE
            assert one.call(ChangeState, f"/{NODE}/change_state", request).success
            assert not one.call(Trigger, f"/{NODE}/reset", Trigger.Request()).success
        finally:
            one.close()
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=20.0)
    finally:
        process.kill()
    assert process.returncode == 0, rest
    assert "Traceback" not in rest
