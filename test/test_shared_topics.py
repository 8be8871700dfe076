"""Topics that several publish to: a gripper beside the arm, an arm in parts, joints under other names."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from robots import urdf

from sysid_ros.cli.inputs import open_bag
from sysid_ros.cli.main import run
from sysid_ros.exceptions import RobotModelError
from sysid_ros.input_gate import InputGate
from sysid_ros.input_gate.joined import JoinedRecords
from sysid_ros.input_gate.raw_messages import read_messages
from sysid_ros.online.live_estimation import CommitGate, LiveEstimation
from sysid_ros.online_settings import CommitSettings, OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import JointStateRecord
from sysid_ros.sources import BagRecorder

START, RATE = 1000.0, 200.0
ARM = ("lift", "left_shoulder", "left_wrist")
LEFT = RobotModel.from_urdf(urdf("tree_robot"), ARM)


@cache
def motion(seconds: float = 2.0, shift: float = 0.0) -> tuple[JointStateRecord, ...]:
    """The left arm on a smooth path, each stamp ``shift`` [s] later."""
    records = []
    w = np.linspace(1.5, 2.5, LEFT.n)
    for k in range(round(seconds * RATE)):
        s = k / RATE + shift
        q, v, a = 0.1 + 0.05 * np.sin(w * s), 0.05 * w * np.cos(w * s), -0.05 * w**2 * np.sin(w * s)
        t = START + s
        records.append(JointStateRecord(t, t + 1e-4, LEFT.joint_names, q, v, LEFT.rnea(q, v, a)))
    return tuple(records)


def some_of(record: JointStateRecord, names: Sequence[str]) -> JointStateRecord:
    index = [record.names.index(name) for name in names]
    arrays = (np.asarray(x)[index] for x in (record.position, record.velocity, record.effort))
    return JointStateRecord(record.stamp, record.receive_time, tuple(names), *arrays)


def in_order(*streams: Sequence[JointStateRecord]) -> list[JointStateRecord]:
    return sorted((r for stream in streams for r in stream), key=lambda r: r.receive_time)


def in_parts(seconds: float = 2.0) -> list[JointStateRecord]:
    """Two joints by one publisher, the third by another, 2 ms later."""
    return in_order([some_of(r, ARM[:2]) for r in motion(seconds)], [some_of(r, ARM[2:]) for r in motion(seconds, shift=0.002)])


def fingers(every: int = 5, effort: tuple[float, ...] = (3.0,)) -> list[JointStateRecord]:
    return [JointStateRecord(r.stamp + 1e-3, r.receive_time + 1e-3, ("grip",), (0.01,), (), effort) for r in motion()[::every]]


def recorded(path: Path, records: Sequence[JointStateRecord], storage: str = "mcap") -> Path:
    with BagRecorder(path, storage) as recorder:
        recorder.write_robot_description(urdf("tree_robot"), START)
        recorder.write_joint_states(records)
    return path


def gate_of() -> InputGate:
    return InputGate(LEFT, OnlineSettings(effort_type="external"))


def test_parts_are_put_together_by_their_own_stamps() -> None:
    gate = gate_of()
    found = list(gate.measurements(in_parts()))
    whole = list(gate_of().measurements(motion()))
    assert len(found) >= len(whole) - 2
    by_time = {m.t: m for m in whole}
    for m in found:
        np.testing.assert_allclose(m.q, by_time[m.t].q, atol=1e-5)  # 2nd derivative times the square of the step over 8
        np.testing.assert_allclose(m.tau, by_time[m.t].tau, atol=1e-3)
    assert (gate.counts, gate.received) == ({}, gate.accepted)
    assert any("completed by left_wrist" in note for note in gate.notes)
    # where the values are not interpolated, they are 2 ms late
    assert np.max(np.abs(np.diff([m.q[2] for m in whole]))) > 1e-4


@pytest.mark.parametrize("records", [in_parts, lambda: in_order(motion(), fingers())], ids=["parts", "gripper"])
def test_raw_channels_of_a_diagnosis_are_joined_alike(records: Callable[[], list[JointStateRecord]]) -> None:
    recording, notes = read_messages("run", records(), LEFT, OnlineSettings())
    assert len(recording.t) >= len(motion()) - 3
    assert np.all(np.diff(recording.t) > 0.0)
    assert notes


def test_a_part_that_stays_away_is_a_fault_by_name() -> None:
    gate = gate_of()
    halves = in_parts(2.0)
    silent = [r for r in halves if r.names == ARM[:2] or r.stamp < START + 1.0]
    found = list(gate.measurements(silent))
    assert max(m.t for m in found) < START + 1.0
    assert gate.counts["joints_missing"] > 50
    assert "left_wrist" in gate.health(silent[-1].receive_time).text


def test_a_part_that_comes_too_seldom_is_not_interpolated() -> None:
    seldom = in_order([some_of(r, ARM[:2]) for r in motion()], [some_of(r, ARM[2:]) for r in motion()[::60]])
    gate = gate_of()
    found = [m.t - START for m in gate.measurements(seldom)]
    np.testing.assert_allclose(np.mod(np.array(found) + 0.01, 0.3), 0.01, atol=1e-6)  # where both came at once
    assert gate.counts["joints_missing"] > 200


def test_a_part_beside_whole_messages_is_left_out() -> None:
    gate = gate_of()
    twice = in_order(motion(), [some_of(r, ARM[1:]) for r in motion(shift=0.002)])
    assert len(list(gate.measurements(twice))) == len(motion())
    assert (gate.counts, gate.others) == ({}, len(motion()))


def test_the_clock_of_a_bag_that_is_played_again_goes_back() -> None:
    joined = JoinedRecords(ARM)
    again = [replace(r, receive_time=r.receive_time + 10.0) for r in in_parts()]
    made = [whole for r in (*in_parts(), *again) for whole in joined.take(r)]
    assert len([r for r in made if len(r.names) == 3]) > 1.9 * len(motion())


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize(("shared", "joints"), [("gripper", ARM), ("silent gripper", ARM), ("parts", ARM)])
def test_bags_choose_the_arm(tmp_path: Path, storage: str, shared: str, joints: tuple[str, ...]) -> None:
    streams: dict[str, tuple[Sequence[JointStateRecord], ...]] = {
        "gripper": (motion(), fingers()),
        "silent gripper": (motion(), fingers(1, ())),
        "parts": (in_parts(),),
    }
    path = recorded(tmp_path / "bag", in_order(*streams[shared]), storage)
    source, robot = open_bag(path, "/joint_states", None, OnlineSettings())
    assert robot.joint_names == joints
    assert robot.flange == "left_hand"
    gate = InputGate(robot, OnlineSettings(effort_type="external"))
    assert len(list(gate.measurements(source))) >= len(motion()) - 2
    assert gate.counts == {}


@pytest.mark.parametrize(("effort", "moves"), [(np.nan, False), (0.0, False), (2.0, True)])
def test_fingers_in_the_arms_messages_count_where_their_effort_is_measured(tmp_path: Path, effort: float, moves: bool) -> None:
    def with_grip(r: JointStateRecord) -> JointStateRecord:
        q, v, tau = (np.append(x, y) for x, y in ((r.position, 0.01), (r.velocity, 0.0), (r.effort, effort)))
        return JointStateRecord(r.stamp, r.receive_time, (*r.names, "grip"), q, v, tau)

    records = [with_grip(r) for r in motion()]
    source, robot = open_bag(recorded(tmp_path / "bag", records), "/joint_states", None, OnlineSettings())
    assert robot.joint_names == (*ARM, *(("grip",) if moves else ()))
    assert robot.flange == "left_hand"
    gate = InputGate(robot, OnlineSettings(effort_type="external"))
    assert len(list(gate.measurements(source))) == len(records)


def test_live_a_gripper_is_another_publisher_and_an_arm_in_parts_is_one_arm() -> None:
    for records in (in_order(motion(), fingers(2)), in_parts()):
        live = LiveEstimation(urdf("tree_robot"), OnlineSettings(effort_type="external"), CommitGate(CommitSettings()))
        for record in records:
            live.take(record)
        assert live.robot.joint_names == ARM
        assert live.gate is not None
        assert live.gate.counts == {}
        assert live.gate.accepted > 0.7 * len(motion())
        assert live.troubles == {}


def test_joints_by_the_names_that_the_messages_have(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    others = ("a", "b", "c", "d")
    four = RobotModel.from_urdf(urdf("small_arm"))
    records = [
        JointStateRecord(START + 0.01 * k, START + 0.01 * k, ("x", *others), np.full(5, 0.1), np.zeros(5), np.arange(5.0))
        for k in range(30)
    ]
    with BagRecorder(tmp_path / "bag") as recorder:
        recorder.write_robot_description(urdf("small_arm"), START)
        recorder.write_joint_states(records)
    settings = OnlineSettings(joint_names=others)
    source, robot = open_bag(tmp_path / "bag", "/joint_states", None, settings)
    assert robot.joint_names == four.joint_names
    (said,) = [line for line in capsys.readouterr().err.splitlines() if "taken for" in line]
    assert f"a is {four.joint_names[0]}" in said
    gate = InputGate(robot, OnlineSettings(effort_type="external", joint_names=others))
    np.testing.assert_array_equal(next(gate.measurements(source)).tau, [1.0, 2.0, 3.0, 4.0])
    with pytest.raises(RobotModelError, match="joint-names NAME"):
        open_bag(tmp_path / "bag", "/joint_states", None, OnlineSettings())


@pytest.mark.parametrize("command", ["replay", "identify", "diagnose", "frequency"])
def test_joint_names_that_do_not_fit_are_said_with_the_nearest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    bag = recorded(tmp_path / "bag", motion())
    out = {"identify": ["--out", str(tmp_path / "m.yaml")], "diagnose": ["--out", str(tmp_path / "d")]}.get(command, [])
    assert run([command, str(bag), *out, "--joint-names", "lift", "left_sholder"]) == 2
    said = " ".join("".join(capsys.readouterr()).split())
    for word in ("left_sholder", "left_shoulder for left_sholder", "right_shoulder"):
        assert word in said


def test_replay_says_what_it_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = recorded(tmp_path / "bag", in_order(motion(2.0), fingers()))
    config = tmp_path / "config.yaml"
    config.write_text("effort_type: external\n")
    run(["replay", str(path), "--config", str(config), "--joint-names", *ARM, "--json", str(tmp_path / "out.json")])
    document = json.loads((tmp_path / "out.json").read_text())
    assert document["samples"] == {"read": len(motion(2.0)), "used": len(motion(2.0)), "rejected": {}}
    assert document["frame"] == "left_hand"
    assert f"{len(fingers())} of grip" in " ".join(document["notes"])
    assert "of grip" in capsys.readouterr().out
