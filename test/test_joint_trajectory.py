"""A trajectory as a message: YAML and bag say the same, and what a controller refuses is refused here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader

from sysid_ros.exceptions import BagError, DataError
from sysid_ros.sources.joint_trajectory import JOINT_TRAJECTORY, JointTrajectory

TOPIC = "/joint_trajectory_controller/joint_trajectory"


def trajectory(count: int = 5, names: tuple[str, ...] = ("a", "it's b")) -> JointTrajectory:
    random = np.random.default_rng(0)
    q, v, a = random.normal(size=(3, count, len(names)))
    return JointTrajectory(names, 0.25 * np.arange(float(count)) + 0.1, q, v, a)


def test_yaml_holds_every_number() -> None:
    message = trajectory()
    document = yaml.safe_load(message.yaml("two\nlines"))
    assert set(document) == {"header", "joint_names", "points"}
    assert document["joint_names"] == ["a", "it's b"]
    for k, point in enumerate(document["points"]):
        assert point["positions"] == pytest.approx(message.q[k], abs=1e-7)
        assert point["velocities"] == pytest.approx(message.v[k], abs=1e-7)
        assert point["accelerations"] == pytest.approx(message.a[k], abs=1e-7)
        time = point["time_from_start"]
        assert time["sec"] + 1e-9 * time["nanosec"] == pytest.approx(message.t[k])
        assert all(type(x) is float for key in ("positions", "velocities", "accelerations") for x in point[key])


def test_zero_has_no_sign() -> None:
    zero = np.full((1, 1), -1e-12)
    assert "-0.0000000" not in JointTrajectory(("a",), np.zeros(1), zero, zero, zero).yaml()


def test_the_goal_of_an_action_is_the_message_two_columns_in() -> None:
    text = trajectory().yaml("comment")
    goal = "trajectory:\n" + "".join(f"  {line}\n" for line in text.splitlines())
    assert yaml.safe_load(goal) == {"trajectory": yaml.safe_load(text)}


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_the_bag_holds_the_message_and_the_description(tmp_path: Path, storage: str) -> None:
    message = trajectory()
    message.write_bag(tmp_path / "bag", TOPIC, "<robot/>", storage)
    with AnyReader([tmp_path / "bag"]) as reader:
        read = {c.topic: reader.deserialize(data, c.msgtype) for c, _, data in reader.messages()}
        assert {c.topic: c.msgtype for c in reader.connections}[TOPIC] == JOINT_TRAJECTORY
    assert read["/robot_description"].data == "<robot/>"
    found = read[TOPIC]
    assert found.joint_names == ["a", "it's b"]
    assert found.header.stamp.sec == found.header.stamp.nanosec == 0
    for k, point in enumerate(found.points):
        assert np.array_equal(point.positions, message.q[k])
        assert np.array_equal(point.velocities, message.v[k])
        assert np.array_equal(point.accelerations, message.a[k])
        assert point.effort.size == 0
        assert point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec == pytest.approx(message.t[k])


def test_what_is_no_trajectory_is_refused(tmp_path: Path) -> None:
    good = trajectory()
    with pytest.raises(DataError, match="ascend"):
        JointTrajectory(good.joint_names, good.t[::-1], good.q, good.v, good.a)
    with pytest.raises(DataError, match="ascend"):
        JointTrajectory(good.joint_names, 0.0 * good.t, good.q, good.v, good.a)
    with pytest.raises(DataError, match="shapes"):
        JointTrajectory(good.joint_names, good.t, good.q[:, :1], good.v, good.a)
    with pytest.raises(DataError, match="finite"):
        JointTrajectory(good.joint_names, good.t, good.q * np.nan, good.v, good.a)
    with pytest.raises(BagError, match="absolute"):
        good.write_bag(tmp_path / "bag", "joint_trajectory", "<robot/>")
