"""Temperatures in bags: read by topic and frame, matched to joints by name, left out with a word where they can't be right."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnosis_bags import messages, write_temperatures
from robots import robot
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sysid_ros.sample import FloatArray, JointStateRecord, TemperatureSeries
from sysid_ros.signals.recording import Recording
from sysid_ros.signals.temperature import joint_of, with_temperatures
from sysid_ros.sources import BagRecorder, BagSource, temperatures
from sysid_ros.sources.joint_state_cdr import JOINT_STATE, encode, encode_names
from sysid_ros.sources.temperatures import DYNAMIC

ARM = "small_arm"
JOINT = 1


@pytest.mark.parametrize(
    ("topic", "frame", "joint"),
    [
        ("/joint_temperature", "lift", 1),
        ("/joint_temperature", "upper_arm", 1),
        ("/joint_temperature", "/forearm", 2),
        ("/arm/elbow/temperature", "", 2),
        ("/arm/temperature/elbow", "base", 2),
        ("/arm/elbow_motor_temperature", "", 2),
        ("/temperature_turn", "", 0),
        ("/arm/slide_temp", "", 3),
        ("/lift/temperature", "turn", 0),
        ("/imu/temperature", "imu_link", None),
        ("/temperature", "", None),
        ("/lift/elbow/temperature", "", None),
    ],
)
def test_names_tell_the_joint(topic: str, frame: str, joint: int | None) -> None:
    assert joint_of(TemperatureSeries(topic, frame, np.zeros(1), np.zeros(1)), robot(ARM)) == joint


def test_what_can_not_be_right_is_said_and_left_out() -> None:
    still = np.zeros((800, 4))
    r = Recording("still", 50.0 + np.arange(800) / 200.0, still, None, still)
    t = 50.0 + np.arange(5.0)

    def told(values: list[float], frame: str = "lift", shift: float = 0.0) -> tuple[FloatArray | None, str]:
        out, sentences = with_temperatures(r, robot(ARM), [TemperatureSeries("/t", frame, t + shift, np.array(values))])
        return out.temperature, " ".join(sentences)

    good, words = told([20.0, 21.0, 22.0, 23.0, 24.0])
    assert good is not None
    assert words == ""
    np.testing.assert_allclose(good[:, JOINT], np.minimum(20.0 + r.t - 50.0, 24.0), atol=1e-9)
    some, words = told([20.0, 999.0, np.nan, 23.0, 24.0])
    assert some is not None
    np.testing.assert_allclose(some[:, JOINT], good[:, JOINT], atol=1e-9)
    assert "2 of 5 readings" in words
    assert "999" in words
    for values, why in (([0.0] * 5, "not connected"), ([293.0 + x for x in range(5)], "degrees Celsius"), ([-99.0] * 5, "-99")):
        none, words = told(values)
        assert none is None
        assert why in words
    for shift in (1000.0, -1000.0):
        none, words = told([20.0] * 5, shift=shift)
        assert none is None
        assert "stamps" in words
    none, words = told([20.0] * 5, frame="gripper")
    assert none is None
    assert "/t (gripper)" in words
    assert "turn, lift, elbow, slide" in words
    two = [TemperatureSeries(topic, "lift", t, np.full(5, x)) for topic, x in (("/a", 30.0), ("/b", 40.0))]
    first, sentences = with_temperatures(r, robot(ARM), two)
    assert first.temperature is not None
    assert first.temperature[0, JOINT] == 30.0
    assert "/b (lift) is not" in sentences[0]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_topics_of_temperatures_are_read_by_frame(tmp_path: Path, storage: str) -> None:
    t, names = 100.0 + np.arange(6.0), robot(ARM).joint_names
    with BagRecorder(tmp_path / "run", storage) as recorder:
        recorder.write_joint_states(messages(0, 5.0))
        for k, name in enumerate(names):
            write_temperatures(recorder, "/joint_temperature", name, t, 30.0 + k + t - 100.0)
        write_temperatures(recorder, "/elbow/temperature", "", t, 50.0 + 0.0 * t)
    found, notes = temperatures(BagSource(tmp_path / "run"))
    assert notes == ()
    assert [(s.topic, s.frame) for s in found] == [("/elbow/temperature", ""), *(("/joint_temperature", n) for n in names)]
    for k, series in enumerate(found[1:]):
        np.testing.assert_allclose(series.t, t)
        np.testing.assert_allclose(series.values, 30.0 + k + t - 100.0)


INTERFACES = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    DYNAMIC: "std_msgs/Header header\nstring[] joint_names\nInterfaceValue[] interface_values\n",
}


def dynamic_bag(path: Path, records: list[JointStateRecord], values: dict[str, dict[str, float]], storage: StoragePlugin) -> Path:
    """Joint states and dynamic joint states, each joint with some interfaces."""
    store: Any = get_typestore(Stores.ROS2_JAZZY)
    for name, text in INTERFACES.items():
        store.register(get_types_from_msg(text, name))
    kinds = store.types
    with Writer(path, version=9, storage_plugin=storage) as writer:
        joints = writer.add_connection("/joint_states", JOINT_STATE, typestore=store)
        dynamic = writer.add_connection("/dynamic_joint_states", DYNAMIC, typestore=store)
        for r in records:
            time = round(r.receive_time * 1e9)
            writer.write(joints, time, encode(r, encode_names(r.names)))
            stamp = kinds["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9)
            parts = [
                kinds["control_msgs/msg/InterfaceValue"](list(v), np.array(list(v.values()), dtype=float))
                for v in values.values()
            ]
            message = kinds[DYNAMIC](kinds["std_msgs/msg/Header"](stamp, ""), list(values), parts)
            writer.write(dynamic, time, store.serialize_cdr(message, DYNAMIC))
    return path


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_dynamic_joint_states_are_read_by_the_definition_in_the_bag(tmp_path: Path, storage: StoragePlugin) -> None:
    values = {
        "lift": {"position": 0.1, "temperature": 41.0, "motor_temperature": 55.0},
        "elbow": {"position": 0.2, "Present Temperature": 42.0},
        "slide": {"position": 0.3},
    }
    found, notes = temperatures(BagSource(dynamic_bag(tmp_path / "run", messages(0, 3.0), values, storage)))
    assert notes == ()
    assert [s.frame for s in found] == ["lift", "elbow"]
    for series, value in zip(found, (55.0, 42.0), strict=True):
        assert 25 <= len(series.t) <= 31  # ten a second, whatever the rate of the controller
        assert set(series.values) == {value}
    without, notes = temperatures(
        BagSource(dynamic_bag(tmp_path / "other", messages(0, 3.0), {"lift": {"position": 0.1}}, storage))
    )
    assert (without, notes) == ([], ())


def test_a_bag_that_does_not_define_its_messages_says_so(tmp_path: Path) -> None:
    path = dynamic_bag(tmp_path / "run", messages(0, 1.0), {"lift": {"temperature": 40.0}}, StoragePlugin.SQLITE3)
    (database,) = path.glob("*.db3")
    with sqlite3.connect(database) as connection:
        connection.execute("DELETE FROM message_definitions")
    found, (note,) = temperatures(BagSource(path))
    assert found == []
    assert "/dynamic_joint_states" in note
    assert "does not define control_msgs/msg/DynamicJointState" in note
