"""``sysid excite``: what it writes is what a controller takes, what it says, and bad input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader
from test_collision_model import chain

from sysid_ros.cli.main import run

QUICK = ["--duration", "2", "--harmonics", "2", "--starts", "1", "--comparison", "2"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("excite")
    (path / "arm.urdf").write_text(chain())
    return path


@pytest.fixture(scope="module")
def done(folder: Path) -> dict[str, Any]:
    out = ["--out", str(folder / "traj.yaml"), "--bag", str(folder / "bag"), "--json", str(folder / "out.json")]
    arguments = ["excite", "--urdf", str(folder / "arm.urdf"), *out, "--plot", str(folder / "plot.png"), "--rate", "50"]
    assert run([*arguments, "--floor", "-0.4", "--clearance", "0.01", *QUICK]) == 0
    document: dict[str, Any] = json.loads((folder / "out.json").read_text())
    return document


def test_the_message_is_one_that_a_controller_takes(folder: Path, done: dict[str, Any]) -> None:
    message = yaml.safe_load((folder / "traj.yaml").read_text())
    assert message["joint_names"] == ["joint1", "joint2", "joint3"]
    assert message["header"]["stamp"] == {"sec": 0, "nanosec": 0}
    points = message["points"]
    times = np.array([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points])
    assert times == pytest.approx(np.arange(0.0, 2.0 + 1e-9, 0.02))
    for end in (points[0], points[-1]):
        assert end["positions"] == pytest.approx(done["motion"]["start"], abs=1e-6)
        assert end["velocities"] == end["accelerations"] == [0.0, 0.0, 0.0]
    assert all(len(p[key]) == 3 for p in points for key in ("positions", "velocities", "accelerations"))


def test_the_bag_says_the_same(folder: Path, done: dict[str, Any]) -> None:
    points = yaml.safe_load((folder / "traj.yaml").read_text())["points"]
    with AnyReader([folder / "bag"]) as reader:
        read = {c.topic: reader.deserialize(data, c.msgtype) for c, _, data in reader.messages()}
    assert read["/robot_description"].data == chain()
    found = read["/joint_trajectory_controller/joint_trajectory"]
    assert len(found.points) == len(points)
    for mine, theirs in zip(points, found.points, strict=True):
        assert mine["positions"] == pytest.approx(theirs.positions, abs=1e-7)
        assert mine["accelerations"] == pytest.approx(theirs.accelerations, abs=1e-7)


def test_the_series_in_json_is_the_motion(folder: Path, done: dict[str, Any]) -> None:
    points = yaml.safe_load((folder / "traj.yaml").read_text())["points"]
    motion = done["motion"]
    t = 0.02 * np.arange(len(points))
    phase = np.multiply.outer(t, 2.0 * np.pi / motion["period"] * np.arange(1, len(motion["sine"]) + 1))
    q = np.array(motion["offset"]) + np.sin(phase) @ np.array(motion["sine"]) + np.cos(phase) @ np.array(motion["cosine"])
    assert q == pytest.approx(np.array([p["positions"] for p in points]), abs=1e-6)


def test_json_holds_criteria_before_and_after(done: dict[str, Any]) -> None:
    criteria = done["criteria"]
    assert criteria["after"]["d"] > criteria["before_best"]["d"] >= criteria["before_median"]["d"]
    assert len(criteria["random_d"]) == 2
    for values in criteria.values():
        if isinstance(values, dict):
            assert set(values) == {"d", "a", "e", "condition_number", "unweighted_condition_number"}
    assert all(0.0 <= x <= 1.0 for kind in done["use"].values() for x in kind)
    assert all(pair["distance"] >= pair["keep"] for pair in done["pairs"])
    assert len(done["base_parameters"]) == len(set(done["base_parameters"]))


def test_tables_on_stdout_and_messages_on_stderr(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    urdf, out = str(folder / "arm.urdf"), folder / "again.yaml"
    assert run(["excite", "--urdf", urdf, "--out", str(out), "--joint-names", "joint1", "joint3", *QUICK, "--approach", "4"]) == 0
    captured = capsys.readouterr()
    for word in ("criterion", "condition", "median", "joint3", "--start"):
        assert word in captured.out
    assert "joint2" in captured.err
    assert "--floor" in captured.err
    assert "acceleration" in captured.err
    message = yaml.safe_load(out.read_text())
    assert message["joint_names"] == ["joint1", "joint3"]
    assert message["points"][0]["time_from_start"] == {"sec": 4, "nanosec": 0}


def test_limits_from_a_file_are_kept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limits, out = folder / "limits.yaml", folder / "slow.yaml"
    limits.write_text("joint_limits:\n  joint2: {max_velocity: !degrees 10, max_position: 0.5}\n  gripper: {max_velocity: 1}\n")
    arguments = ["excite", "--urdf", str(folder / "arm.urdf"), "--out", str(out), "--limits", str(limits), *QUICK]
    assert run([*arguments, "--velocity-scale", "1"]) == 0
    assert "gripper" in capsys.readouterr().err
    points = yaml.safe_load(out.read_text())["points"]
    assert max(abs(p["velocities"][1]) for p in points) <= np.radians(10.0)
    assert max(p["positions"][1] for p in points) <= 0.5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--urdf", "{tmp}/none.urdf"], "none.urdf"),
        (["--out", "{tmp}/no/such/t.yaml"], "no/such"),
        (["--bag", "{tmp}"], "exists already"),
        (["--plot", "{tmp}/p.jpg"], ".jpg"),
        (["--harmonics", "1"], "harmonics"),
        (["--duration", "10", "--period", "3"], "whole number of periods"),
        (["--velocity-scale", "2"], "--velocity-scale is 2"),
        (["--rate", "0"], "--rate is 0"),
        (["--approach", "-1"], "--approach is -1"),
        (["--joint-names", "wrist"], "wrist"),
        (["--start", "0,0"], "--start has 2 values"),
        (["--start", "0,a,0"], "numbers with commas"),
        (["--start", "0,2.99,0"], "joint2"),
        (["--floor", "3"], "no motion is feasible"),
        (["--effort-scale", "0.0001", "--position-scale", "0.1"], "N m to hold still"),
        (["--ignore-pair", "link1"], "--ignore-pair"),
        (["--ignore-pair", "link1,moon"], "moon"),
        (["--limits", "{tmp}/none.yaml"], "none.yaml"),
        (["--config", "{tmp}/none.yaml"], "none.yaml"),
    ],
)
def test_bad_input_is_a_message_and_exit_code_2(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    given = ["excite", "--urdf", str(folder / "arm.urdf"), "--out", str(tmp_path / "t.yaml"), *QUICK]
    text = folder / "arm.urdf"
    if "--effort-scale" in arguments:
        # turned so that gravity pulls at every joint in every posture
        text = tmp_path / "turned.urdf"
        text.write_text(chain().replace('axis xyz="0 1 0"', 'axis xyz="0 0.6 0.8"'))
        given[2] = str(text)
    assert run([*given, *(a.format(tmp=tmp_path) for a in arguments)]) == 2
    captured = capsys.readouterr()
    assert message in captured.err.replace("\n", " ")
    assert "Traceback" not in captured.err
    assert not (tmp_path / "t.yaml").exists()


def test_help_says_how_to_send_the_motion(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["excite", "--help"]) == 0
    text = capsys.readouterr().out
    for word in ("ros2 topic pub", "send_goal", "ros2 bag play", "Example", "Exit codes"):
        assert word in text
