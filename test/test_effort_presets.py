"""Efforts that are motor currents: presets with a source, used where they are asked for and nowhere else."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from robots import robot

from sysid_ros.cli.main import run
from sysid_ros.exceptions import SettingsError
from sysid_ros.input_gate import InputGate
from sysid_ros.input_gate.mapping import effort_factor
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.effort_presets import PRESETS, offer, said
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.sources import BagRecorder

START = 1000.0


@cache
def ur5() -> RobotModel:
    path = packaged("ur5_robot")
    if path is None:
        pytest.skip("example-robot-data is not installed")
    return RobotModel.from_urdf(path.read_text())


def in_amperes(seconds: float, gains: FloatArray) -> list[JointStateRecord]:
    """A UR5 on a smooth path, its torques divided by the gains."""
    model, records = ur5(), []
    w = np.linspace(0.5, 1.5, model.n)
    for k in range(round(seconds * 100.0)):
        t = 0.01 * k
        q, v, a = 1.2 * np.sin(w * t) - 0.6, 1.2 * w * np.cos(w * t), -1.2 * w**2 * np.sin(w * t)
        current = model.rnea(q, v, a) / gains + 0.01 * np.sin(997.0 * t * w)
        records.append(JointStateRecord(START + t, START + t, model.joint_names, q, v, current))
    return records


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_says_what_it_is_and_where_it_is_from(name: str) -> None:
    one = PRESETS[name]
    assert len(one.joints) == len(one.scale) == len(set(one.joints))
    assert all(5.0 < x < 20.0 for x in one.scale)  # torque constants of about 0.1 N m/A behind gears of about 100
    (text,) = said(name)
    for word in (f"N m per {one.unit}", one.source, *one.joints, *(f"{x:g}" for x in one.scale)):
        assert word in text
    assert re.search(r"\b(19|20)\d\d\b", one.source)


@pytest.mark.parametrize("name", PRESETS)
def test_factors_follow_the_names_of_the_joints(name: str) -> None:
    one = PRESETS[name]
    turned = [f"left_{joint}" for joint in reversed(one.joints)]
    np.testing.assert_array_equal(one.of(turned), one.scale[::-1])
    assert one.of([*turned, "finger_joint"]) is None


def test_none_is_taken_that_was_not_asked_for() -> None:
    assert said(OnlineSettings().effort_preset) == ()
    np.testing.assert_array_equal(effort_factor(ur5(), OnlineSettings()), np.ones(6))


def test_currents_become_torques_and_the_notes_say_so() -> None:
    gains = np.array(PRESETS["ur5"].scale)
    gate = InputGate(ur5(), OnlineSettings(effort_preset="ur5", effort_sign=(1.0, -1.0, 1.0, 1.0, 1.0, 1.0)))
    records = in_amperes(0.1, gains)
    for record, m in zip(records, gate.measurements(records), strict=True):
        np.testing.assert_allclose(m.tau, record.effort * gains * [1, -1, 1, 1, 1, 1])
    assert gate.notes == said("ur5")


def test_efforts_that_look_like_currents_are_told_which_presets_there_are() -> None:
    gate = InputGate(ur5(), OnlineSettings())
    list(gate.measurements(in_amperes(25.0, np.array(PRESETS["ur5"].scale))))
    text = " ".join(gate.warnings)
    assert "motor current" in text
    assert "--effort-preset) ur5, ur10, ur10e" in text
    assert offer(robot("small_arm").joint_names) == ""


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"effort_preset": "ur99"}, ["'ur99'", "ur5, ur10, ur10e", "effort_scale"]),
        ({"effort_preset": "ur5"}, ["shoulder_pan_joint", "elbow", "effort_scale"]),
        ({"effort_preset": "ur5", "effort_scale": (1.0,) * 4}, ["Give one of them"]),
    ],
)
def test_a_preset_that_does_not_fit(settings: dict[str, object], words: list[str]) -> None:
    with pytest.raises(SettingsError) as caught:
        InputGate(robot("small_arm"), OnlineSettings(**settings))  # type: ignore[arg-type]
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize("command", ["replay", "identify", "diagnose", "frequency"])
def test_commands_refuse_a_preset_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str) -> None:
    with BagRecorder(tmp_path / "bag") as recorder:
        recorder.write_robot_description(ur5().urdf, START)
        recorder.write_joint_states(in_amperes(1.0, np.ones(6)))
    out = {"identify": ["--out", str(tmp_path / "m.yaml")], "diagnose": ["--out", str(tmp_path / "d")]}.get(command, [])
    assert run([command, str(tmp_path / "bag"), *out, "--effort-preset", "ur1"]) == 2
    assert "ur5, ur10, ur10e" in " ".join(capsys.readouterr().err.split())
