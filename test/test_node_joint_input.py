"""The type in which joint states are published: found out by the node, or named with its cure."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState, MultiDOFJointState
from test_joint_messages import ARM, DYNAMIC, RATE, START, TYPES, dynamic_messages, values
from test_node_payload_estimator import MASS, NAMES, Bench, motion
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sysid_ros.nodes import joint_input, reporter
from sysid_ros.nodes.joint_input import dynamic_joint_states
from sysid_ros.sample import JointStateRecord

TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


@pytest.fixture(scope="module", autouse=True)
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reporter, "_PERIOD", 0.1)
        yield
    rclpy.shutdown()


class OtherBench(Bench):
    """Joint states come in another type, from a participant of its own: DDS takes one type a topic in each."""

    def __init__(self, kind: Any, **parameters: Any) -> None:
        super().__init__(**parameters)
        self.tester.destroy_publisher(self.publisher)
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.driver = rclpy.create_node("driver", namespace=self.namespace, context=self.context)
        self.publisher = self.driver.create_publisher(kind, "joint_states", 100)

    def connect(self) -> None:
        self.until(lambda: self.node._joint_states.subscription.msg_type is self.publisher.msg_type)
        super().connect()

    def close(self) -> None:
        super().close()
        self.driver.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Iterator[OtherBench]:
    made = OtherBench(*request.param)
    yield made
    made.close()


def test_a_record_is_that_of_a_bag() -> None:
    """Interfaces in any order, a sensor, a gripper without effort, which is said once."""
    said: list[str] = []
    record = dynamic_joint_states(said.append)
    for k, message in enumerate(dynamic_messages()):
        found = record(message, START)
        assert found.names == ARM
        assert found.stamp == pytest.approx(START + k / RATE, abs=1e-6)
        np.testing.assert_array_equal([found.position, found.velocity, found.effort], values(len(ARM))[k])
    assert said == ["Joints without an effort are left out: grip."]
    broken = TYPES.dynamic(START, {"a": {"position": 1.0}})
    broken.interface_values[0].values = np.zeros(2)
    with pytest.raises(ValueError, match="not as many as its interfaces"):
        record(broken, START)


def of_trajectory(tell: Any) -> joint_input.Record:
    """Joint states out of a type that is installed wherever rclpy is."""

    def record(message: Any, receive_time: float) -> JointStateRecord:
        stamp, (point,) = message.header.stamp, message.points
        t = stamp.sec + 1e-9 * stamp.nanosec
        return JointStateRecord(t, receive_time, tuple(message.joint_names), point.positions, point.velocities, point.effort)

    return record


@pytest.mark.parametrize("executor", ["events", "single"])
def test_another_type_on_the_topic_is_found_and_read(executor: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(joint_input.OTHERS, TRAJECTORY, of_trajectory)
    bench = OtherBench(JointTrajectory, executor=executor)
    try:
        start = bench.tester.get_clock().now().nanoseconds * 1e-9
        messages = []
        for m in motion(6.0, start):
            point = JointTrajectoryPoint(positions=m.position, velocities=m.velocity, effort=m.effort)
            messages.append(JointTrajectory(header=m.header, joint_names=NAMES, points=[point]))
        broken = JointTrajectory(header=messages[-1].header, joint_names=NAMES)
        bench.send(messages)
        assert bench.latest.mass == pytest.approx(MASS, abs=0.05)
        assert not bench.node._joint_states.problem
        bench.publisher.publish(broken)
        bench.until(lambda: bench.values("input").get("trouble.ValueError") == "1")
    finally:
        bench.close()


@pytest.mark.parametrize("bench", [(MultiDOFJointState,)], indirect=True)
def test_a_type_without_efforts_is_named(bench: OtherBench) -> None:
    bench.until(lambda: "input" in bench.statuses and "MultiDOFJointState" in bench.statuses["input"].message)
    assert "Remap joint_states to a topic of one of these" in bench.statuses["input"].message


@pytest.mark.parametrize("bench", [(JointState,)], indirect=True)
def test_a_package_that_is_not_installed_is_named_with_its_cure(bench: OtherBench, monkeypatch: pytest.MonkeyPatch) -> None:
    class Info:
        topic_type = "absent_msgs/msg/DynamicJointState"

    monkeypatch.setitem(joint_input.OTHERS, Info.topic_type, dynamic_joint_states)
    monkeypatch.setattr(Node, "get_publishers_info_by_topic", lambda *args, **kwargs: [Info])
    bench.until(lambda: bool(bench.node._joint_states.problem))
    bench.until(lambda: "input" in bench.statuses and "published as absent_msgs" in bench.statuses["input"].message)
    assert "apt install ros-jazzy-absent-msgs" in bench.statuses["input"].message


def test_dynamic_joint_states_live() -> None:
    messages = pytest.importorskip(
        "control_msgs.msg", reason="control_msgs is not installed (apt install ros-jazzy-control-msgs)"
    )
    bench = OtherBench(messages.DynamicJointState)
    try:
        start, sent = bench.tester.get_clock().now().nanoseconds * 1e-9, []
        for m in motion(6.0, start):
            rows = zip(m.position, m.velocity, m.effort, strict=True)
            names = ["effort", "position", "velocity"]
            parts = [messages.InterfaceValue(interface_names=names, values=[tau, q, v]) for q, v, tau in rows]
            sent.append(messages.DynamicJointState(header=m.header, joint_names=NAMES, interface_values=parts))
        bench.send(sent)
        assert bench.latest.mass == pytest.approx(MASS, abs=0.05)
    finally:
        bench.close()


def test_the_type_of_bags_is_one_that_the_node_knows() -> None:
    assert set(joint_input.OTHERS) == {DYNAMIC}
