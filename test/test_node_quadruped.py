"""The real node on a legged robot: joint states, IMU and contacts in, the payload out."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import InertiaStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float32MultiArray, Float64MultiArray, String

from sysid_ros.nodes.messages import stamp_of
from sysid_ros.nodes.online_payload_estimator import OnlinePayloadEstimator
from sysid_ros.sample import ContactRecord, ImuRecord, JointStateRecord
from sysid_ros.sources import BagSource, FloatingBagSource

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@cache
def bag() -> BagSource:
    return BagSource(Path(__file__).resolve().parents[1] / "bags" / "quadruped_trot")


def source() -> FloatingBagSource:
    return FloatingBagSource(bag())


@cache
def trot() -> list[JointStateRecord | ImuRecord | ContactRecord]:
    return list(source())


@pytest.fixture(scope="module", autouse=True)
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    yield
    rclpy.try_shutdown()


class Walk:
    """The node, and who plays the walk to it."""

    def __init__(self, name: str, contacts: Any = Float32MultiArray, connected: bool = True, **parameters: Any) -> None:
        given = [Parameter(key, value=value) for key, value in parameters.items()]
        self.node = OnlinePayloadEstimator(namespace=name, parameter_overrides=given)
        self.player = rclpy.create_node("player", namespace=name)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.player)
        self.contact_type = contacts
        self.joints = self.player.create_publisher(JointState, "joint_states", 100)
        self.imu = self.player.create_publisher(Imu, "imu", 100)
        self.contacts = self.player.create_publisher(contacts, "contacts", 100)
        self.description = self.player.create_publisher(String, "robot_description", LATCHED)
        self.payloads: list[InertiaStamped] = []
        self.statuses: dict[str, DiagnosticStatus] = {}
        self.kept = (
            self.player.create_subscription(InertiaStamped, "online_payload_estimator/payload", self.payloads.append, 100),
            self.player.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10),
        )
        self.description.publish(String(data=bag().robot_description))
        if not connected:
            return
        self.until(lambda: self.joints.get_subscription_count() and self.imu.get_subscription_count(), 60.0)
        self.until(lambda: self.contacts.get_subscription_count() > 0)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.statuses |= {s.name.rpartition(": ")[2]: s for s in message.status}

    def until(self, condition: Callable[[], Any], seconds: float = 15.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"waited in vain; {[(n, s.message) for n, s in self.statuses.items()]}"
            self.executor.spin_once(timeout_sec=0.05)

    def publish_joints_until(self, condition: Callable[[], Any]) -> None:
        """Send the first joint states over and over, to a node that may not listen."""
        first = next(r for r in trot() if not isinstance(r, ImuRecord | ContactRecord))
        end = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < end, f"waited in vain; {[(n, s.message) for n, s in self.statuses.items()]}"
            message = JointState(name=list(first.names), position=[float(x) for x in first.position])
            message.header.stamp = stamp_of(time.time())
            self.joints.publish(message)
            self.executor.spin_once(timeout_sec=0.05)

    def play(
        self,
        shift: float,
        frame: str | None = None,
        imu: bool = True,
        imu_late: float = 0.0,
        done: Callable[[], Any] = lambda: False,
    ) -> None:
        """Publish the walk, stamps later by ``shift``, until its end or ``done``; a few messages at a time, once those before are
        read."""
        gate = self.node.live.gate if self.node.live is not None else None
        before = 0 if gate is None else gate.received
        joints = 0
        for k, record in enumerate(trot()):
            if isinstance(record, ContactRecord):
                self.contacts.publish(self.contact_type(data=[float(x) for x in record.values]))
            elif isinstance(record, ImuRecord):
                if not imu:
                    continue
                message = Imu()
                message.header.stamp = stamp_of(record.stamp + shift + imu_late)
                message.header.frame_id = frame or record.frame_id
                w, f = message.angular_velocity, message.linear_acceleration
                w.x, w.y, w.z = map(float, record.omega)
                f.x, f.y, f.z = map(float, record.specific_force)
                self.imu.publish(message)
            else:
                joints += 1
                state = JointState(
                    name=list(record.names),
                    position=[float(x) for x in record.position],
                    velocity=[float(x) for x in record.velocity],
                    effort=[float(x) for x in record.effort],
                )
                state.header.stamp = stamp_of(record.stamp + shift)
                self.joints.publish(state)
            if k % 30 == 29:
                wanted = before + joints
                self.until(
                    partial(lambda live, wanted: live.gate is not None and live.gate.received >= wanted, self.node.live, wanted)
                )
                if done():
                    return

    def play_until(self, condition: Callable[[], Any], **fault: Any) -> None:
        """Walk on and on, as a robot does, until ``condition``."""
        end = time.monotonic() + 60.0
        shift = time.time() - trot()[0].receive_time
        while not condition():
            assert time.monotonic() < end, f"waited in vain; {[(n, s.message) for n, s in self.statuses.items()]}"
            self.play(shift, **fault, done=condition)
            shift += trot()[-1].receive_time - trot()[0].receive_time + 0.002

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.player.destroy_node()


@pytest.fixture
def walk() -> Iterator[Callable[..., Walk]]:
    made: list[Walk] = []

    def make(name: str, **arguments: Any) -> Walk:
        made.append(Walk(name, **arguments))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.slow
@pytest.mark.parametrize("contacts", [Float32MultiArray, Float64MultiArray], ids=["float32", "float64"])
def test_the_box_on_a_trotting_robot_is_published(walk: Callable[..., Walk], contacts: Any) -> None:
    one = walk(f"trot_{contacts.__name__.lower()}", contacts=contacts)
    one.play(time.time() - trot()[0].receive_time)
    one.until(lambda: one.payloads and one.payloads[-1].inertia.m > 0.0)
    last = one.payloads[-1]
    assert last.header.frame_id == "trunk"
    assert last.inertia.m == pytest.approx(2.5, rel=0.05)
    assert [last.inertia.com.x, last.inertia.com.y] == pytest.approx([0.05, -0.03], abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "cure"),
    [
        ({"imu": False}, "imu"),
        ({"frame": "camera"}, "imu_frame"),
        ({"imu_late": 1.0}, "Synchronise the clocks"),
        ({"imu_late": -1.0}, "Synchronise the clocks"),
    ],
    ids=["no IMU", "frame", "ahead", "behind"],
)
def test_an_imu_that_can_not_be_used_is_an_error_with_the_cure(
    walk: Callable[..., Walk], fault: dict[str, Any], cure: str, request: pytest.FixtureRequest
) -> None:
    one = walk(f"fault_{request.node.callspec.id.lower().replace(' ', '_')}")

    def told(level: bytes) -> bool:
        return "input" in one.statuses and one.statuses["input"].level == level and cure in one.statuses["input"].message

    one.play_until(lambda: told(DiagnosticStatus.ERROR), **fault)
    one.until(lambda: told(DiagnosticStatus.STALE))
    assert not one.payloads


@pytest.mark.slow
def test_a_foot_that_the_urdf_lacks_is_an_error_with_the_cure(walk: Callable[..., Walk]) -> None:
    one = walk("paw", connected=False, contact_frames=["FR_toe", "FL_toe", "RR_toe", "paw"])
    one.publish_joints_until(lambda: any(s.level == DiagnosticStatus.ERROR and "paw" in s.message for s in one.statuses.values()))
    assert any("contact_frames" in s.message for s in one.statuses.values())
