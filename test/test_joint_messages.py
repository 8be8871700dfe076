"""Joint states in the messages of ros2_control and of Franka arms, by the fields that the bag defines."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robots import urdf
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sysid_ros.cli.inputs import open_bag
from sysid_ros.cli.main import run
from sysid_ros.exceptions import BagError, RobotModelError
from sysid_ros.input_gate import InputGate
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import BagSource

STORAGES = [StoragePlugin.MCAP, StoragePlugin.SQLITE3]
DYNAMIC = "control_msgs/msg/DynamicJointState"
ROBOT_STATE, STATE = "franka_msgs/msg/FrankaRobotState", "franka_msgs/msg/FrankaState"
DEFINITIONS = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    DYNAMIC: "std_msgs/Header header\nstring[] joint_names\nInterfaceValue[] interface_values\n",
    "franka_msgs/msg/CollisionIndicators": "geometry_msgs/Vector3 linear\nfloat64[7] is_joint_collision\n",
    ROBOT_STATE: "std_msgs/Header header\nCollisionIndicators collision_indicators\nsensor_msgs/JointState measured_joint_state\n"
    "sensor_msgs/JointState desired_joint_state\nfloat64[7] ddq_d\nuint8 ROBOT_MODE_IDLE=1\nuint8 robot_mode\n",
    STATE: "std_msgs/Header header\nfloat64[6] cartesian_contact\nfloat64[7] q\nfloat64[7] q_d\nfloat64[7] dq\nfloat64[7] tau_J\n"
    "float64[16] O_T_EE\n",
}
"""As in ros-controls/control_msgs and frankaemika/franka_ros2, those of Franka shortened."""
N, RATE, START = 120, 100.0, 1000.0
PANDA = tuple(f"panda_joint{k}" for k in range(1, 8))


def values(joints: int) -> Any:
    """Positions, velocities and efforts, shape (N, 3, joints)."""
    t = np.arange(N)[:, None] / RATE
    w, phase = 1.0 + np.arange(joints), np.arange(joints)
    return np.stack([0.3 * np.sin(w * t + phase), 0.3 * w * np.cos(w * t + phase), 5.0 * np.cos(0.7 * w * t) + phase], axis=1)


class Types:
    """Messages of the types above."""

    def __init__(self) -> None:
        self.store: Any = get_typestore(Stores.ROS2_JAZZY)
        for name, text in DEFINITIONS.items():
            self.store.register(get_types_from_msg(text, name))
        self.types = self.store.types

    def header(self, t: float, frame: str = "") -> Any:
        sec, nanosec = divmod(round(t * 1e9), 10**9)
        return self.types["std_msgs/msg/Header"](self.types["builtin_interfaces/msg/Time"](sec, nanosec), frame)

    def dynamic(self, t: float, resources: dict[str, dict[str, float]]) -> Any:
        part = self.types["control_msgs/msg/InterfaceValue"]
        parts = [part(list(v), np.array(list(v.values()), dtype=float)) for v in resources.values()]
        return self.types[DYNAMIC](self.header(t), list(resources), parts)

    def robot_state(self, t: float, names: Sequence[str], q: Any, v: Any, tau: Any) -> Any:
        joints = self.types["sensor_msgs/msg/JointState"]
        measured = joints(self.header(t), list(names), np.array(q), np.array(v), np.array(tau))
        desired = joints(self.header(t), list(names), np.array(q), np.zeros(0), np.zeros(0))
        hit = self.types["franka_msgs/msg/CollisionIndicators"](
            self.types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0), np.zeros(7)
        )
        return self.types[ROBOT_STATE](self.header(t, "link0"), hit, measured, desired, np.zeros(7), 1)

    def state(self, t: float, q: Any, v: Any, tau: Any) -> Any:
        return self.types[STATE](self.header(t), np.zeros(6), np.array(q), np.zeros(7), np.array(v), np.array(tau), np.zeros(16))

    def write(self, path: Path, topic: str, kind: str, messages: Sequence[Any], storage: StoragePlugin) -> Path:
        with Writer(path, version=9, storage_plugin=storage) as writer:
            connection = writer.add_connection(topic, kind, typestore=self.store)
            for k, message in enumerate(messages):
                writer.write(connection, round((START + k / RATE + 1e-3) * 1e9), self.store.serialize_cdr(message, kind))
        return path


TYPES = Types()
ARM = RobotModel.from_urdf(urdf("small_arm")).joint_names


def dynamic_messages(efforts: Sequence[str] = ARM) -> list[Any]:
    """Another order of the interfaces in each joint, a gripper without effort, a sensor that is no joint."""
    messages = []
    for k, (q, v, tau) in enumerate(values(len(ARM))):
        resources: dict[str, dict[str, float]] = {"wrist_ft": {"force.x": 1.0, "torque.z": 2.0}, "grip": {"position": 0.01}}
        for j, joint in enumerate(ARM):
            own = {"velocity": v[j], "effort": tau[j], "position": q[j], "temperature": 40.0}
            order = [(*own,), (*own,)[::-1], ("position", "velocity", "effort"), ("effort", "position", "velocity")][j % 4]
            resources[joint] = {name: own[name] for name in order if name != "effort" or joint in efforts}
        messages.append(TYPES.dynamic(START + k / RATE, resources))
    return messages


def assert_read(source: Any, names: Sequence[str], expected: Any) -> None:
    records = list(source)
    assert len(records) == N
    for k, record in enumerate(records):
        assert record.names == tuple(names)
        assert record.stamp == pytest.approx(START + k / RATE, abs=1e-6)
        np.testing.assert_array_equal([record.position, record.velocity, record.effort], expected[k])


@pytest.mark.parametrize("storage", STORAGES)
def test_dynamic_joint_states(tmp_path: Path, storage: StoragePlugin) -> None:
    path = TYPES.write(tmp_path / "bag", "/dynamic_joint_states", DYNAMIC, dynamic_messages(), storage)
    source = BagSource(path)
    assert_read(source, ARM, values(len(ARM)))
    assert source.topic == "/dynamic_joint_states"
    assert any("without an effort are left out: grip" in note for note in source.notes)


def test_dynamic_joint_states_of_a_bag_that_does_not_define_them(tmp_path: Path) -> None:
    path = TYPES.write(tmp_path / "bag", "/dynamic_joint_states", DYNAMIC, dynamic_messages(), StoragePlugin.SQLITE3)
    (database,) = path.glob("*.db3")
    with sqlite3.connect(database) as connection:
        connection.execute("DELETE FROM message_definitions")
    assert_read(BagSource(path), ARM, values(len(ARM)))


def test_dynamic_joint_states_without_any_effort_are_for_the_gate_to_refuse(tmp_path: Path) -> None:
    path = TYPES.write(tmp_path / "bag", "/dynamic_joint_states", DYNAMIC, dynamic_messages(()), StoragePlugin.MCAP)
    first = next(iter(BagSource(path)))
    assert set(first.names) == {"grip", *ARM}
    assert (len(first.velocity), len(first.effort)) == (0, 0)  # the gripper has neither
    robot = RobotModel.from_urdf(urdf("small_arm"))
    gate = InputGate(robot, OnlineSettings())
    assert not list(gate.measurements(BagSource(path)))
    assert set(gate.counts) == {"effort_empty"}


def test_joint_states_are_preferred_to_other_types(tmp_path: Path) -> None:
    store = TYPES.store
    joints = store.types["sensor_msgs/msg/JointState"]
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, kind, message in (
            ("/dynamic_joint_states", DYNAMIC, dynamic_messages()[0]),
            (
                "/arm/joint_states",
                "sensor_msgs/msg/JointState",
                joints(TYPES.header(START), ["a"], np.ones(1), np.ones(1), np.ones(1)),
            ),
        ):
            writer.write(writer.add_connection(topic, kind, typestore=store), 10**12, store.serialize_cdr(message, kind))
    assert BagSource(tmp_path / "bag").joint_names == ("a",)
    assert set(BagSource(tmp_path / "bag", "/dynamic_joint_states").joint_names) == set(ARM)


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("given", ["fr3_joint", "panda_link"])  # older versions put the links' names there
def test_franka_robot_state(tmp_path: Path, storage: StoragePlugin, given: str) -> None:
    names = [f"{given}{k}" for k in range(1, 8)]
    messages = [TYPES.robot_state(START + k / RATE, names, *row) for k, row in enumerate(values(7))]
    path = TYPES.write(tmp_path / "bag", "/franka_robot_state_broadcaster/robot_state", ROBOT_STATE, messages, storage)
    assert_read(BagSource(path), [name.replace("link", "joint") for name in names], values(7))


@pytest.mark.parametrize("storage", STORAGES)
def test_franka_state_takes_the_names_of_the_robot(tmp_path: Path, storage: StoragePlugin) -> None:
    panda = packaged("panda")
    if panda is None:
        pytest.skip("example-robot-data is not installed")
    messages = [TYPES.state(START + k / RATE, *row) for k, row in enumerate(values(7))]
    path = TYPES.write(tmp_path / "bag", "/franka_state_controller/franka_states", STATE, messages, storage)
    source, robot = open_bag(path, "/joint_states", panda, OnlineSettings())
    assert (robot.joint_names, robot.flange) == (PANDA, "panda_link8")
    assert_read(source, PANDA, values(7))
    iiwa_like = tmp_path / "arm.urdf"
    iiwa_like.write_text(urdf("small_arm"))
    with pytest.raises(RobotModelError, match="7 joints and no names"):
        open_bag(path, "/joint_states", iiwa_like, OnlineSettings())


def test_franka_robot_state_of_a_bag_that_does_not_define_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    messages = [TYPES.state(START + k / RATE, *row) for k, row in enumerate(values(7))]
    path = TYPES.write(tmp_path / "bag", "/state", STATE, messages, StoragePlugin.SQLITE3)
    (database,) = path.glob("*.db3")
    with sqlite3.connect(database) as connection:
        connection.execute("DELETE FROM message_definitions")
    assert run(["replay", str(path)]) == 2
    assert "does not define franka_msgs/msg/FrankaState" in " ".join(capsys.readouterr().err.split())


def test_messages_of_another_shape_are_refused(tmp_path: Path) -> None:
    store: Any = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg("std_msgs/Header header\nfloat64 mode\n", STATE))
    message = store.types[STATE](TYPES.header(START), 1.0)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.write(writer.add_connection("/state", STATE, typestore=store), 10**12, store.serialize_cdr(message, STATE))
    with pytest.raises(BagError, match="No topic of it carries sensor_msgs/msg/JointState; it has /state"):
        BagSource(tmp_path / "bag")
    broken = dynamic_messages()
    broken[3].interface_values[0].values = np.zeros(5)
    source = BagSource(TYPES.write(tmp_path / "other", "/dynamic_joint_states", DYNAMIC, broken, StoragePlugin.MCAP))
    assert len(list(source)) == N - 1
    assert any("not as many as its interfaces" in note for note in source.notes)
