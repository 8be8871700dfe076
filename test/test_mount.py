"""A robot on a ceiling, a wall or a slope, whose model has it on the floor: found before all else, and told with the gravity."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded
from diagnosis_bags import bag
from robots import robot, urdf
from unsimulated import unsimulated as unsimulated

from sysid_ros.cli.main import run
from sysid_ros.diagnosis import diagnose
from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.mount import angle_between, mounted_otherwise, turned
from sysid_ros.diagnosis.whose.robot_hypotheses import judge
from sysid_ros.effects.base_tilt import tilt_of, tilted_gravity
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, JointStateRecord
from sysid_ros.signals.conditioning import motions
from sysid_ros.signals.recording import Recording
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel

G = 9.81
FLOOR = np.array([0.0, 0.0, -G])
CEILING, WALL, SLOPE = np.array([0.0, 0.0, G]), np.array([G, 0.0, 0.0]), np.array([0.0, G * np.sin(0.8), -G * np.cos(0.8)])
_ELSEWHERE = [pytest.param(WALL, marks=pytest.mark.slow, id="wall"), pytest.param(SLOPE, marks=pytest.mark.slow, id="slope")]
MOUNTS = pytest.mark.parametrize("gravity", [pytest.param(CEILING, id="ceiling"), *_ELSEWHERE])


@cache
def run_of(gravity: tuple[float, ...], seed: int = 3) -> Recording:
    """An iiwa under a gravity, with friction, rotors, offsets and links that are a little off."""
    model = RobotModel.from_urdf(urdf("iiwa"), gravity=gravity)
    return recorded(model, hidden_parameters(model, 3, links=0.02), seed, seconds=20.0)


@pytest.mark.parametrize("gravity", [FLOOR, CEILING, WALL, SLOPE, np.array([0.0, -G, 0.0])])
def test_roll_and_pitch_are_those_that_gravity_was_turned_by(gravity: FloatArray) -> None:
    for tilt in ((0.0, 0.0), (0.3, -0.2), (-2.5, 0.7), (np.pi / 2, 0.1)):
        tilted = tilted_gravity(gravity, *tilt)
        assert np.linalg.norm(tilted) == pytest.approx(G)
        np.testing.assert_allclose(tilt_of(gravity, tilted), tilt, atol=1e-9)
    across = tilted_gravity(gravity, 0.1, 0.0) - gravity, tilted_gravity(gravity, 0.0, 0.1) - gravity
    assert min(np.linalg.norm(x) for x in across) == pytest.approx(2.0 * G * np.sin(0.05))  # each of them turns it
    assert across[0] @ across[1] == pytest.approx(0.0, abs=0.06)


@MOUNTS
def test_another_mounting_is_found(gravity: FloatArray) -> None:
    found = judge(robot("iiwa"), [run_of(tuple(gravity))])
    assert found is not None
    assert found.refusal is None
    assert found.faults == ()
    assert found.mount is not None
    assert found.mount.probability is not None
    assert found.mount.probability > 0.99
    assert angle_between(found.mount.gravity, gravity) < 0.1
    np.testing.assert_allclose(found.robot.gravity, found.mount.gravity)
    rows = CoarseRows.of(robot("iiwa"), [run_of(tuple(gravity))])
    assert rows is not None
    # a robot whose gravity is set as it is mounted is not mounted otherwise
    assert mounted_otherwise(turned(robot("iiwa"), gravity), rows) is None


def test_the_floor_and_efforts_with_the_wrong_sign_are_no_other_mounting() -> None:
    as_it_is = judge(robot("iiwa"), [run_of(tuple(FLOOR))])
    assert as_it_is is not None
    assert as_it_is.mount is None
    assert as_it_is.robot.gravity.tolist() == FLOOR.tolist()
    r = run_of(tuple(FLOOR))
    flipped = judge(robot("iiwa"), [Recording(r.name, r.t, r.q, r.v, -r.tau)])
    assert flipped is not None
    assert flipped.mount is None
    (fault,) = flipped.faults
    assert fault.effect.id == "torque_sign"
    assert fault.joints == tuple(range(robot("iiwa").n))
    assert flipped.refusal is None


@pytest.mark.slow
def test_currents_of_a_robot_on_the_ceiling() -> None:
    r, constants = run_of(tuple(CEILING)), np.array([10.0, 12.0, 9.0, 5.0, 4.0, 4.0, 3.0])
    found = judge(robot("iiwa"), [Recording(r.name, r.t, r.q, r.v, r.tau / constants)])
    assert found is not None
    assert found.refusal is None
    assert found.mount is not None
    assert angle_between(found.mount.gravity, CEILING) < 0.2
    (fault,) = found.faults
    assert fault.effect.id == "torque_unit"


def test_a_turned_robot_is_a_copy() -> None:
    model = robot("iiwa")
    other = turned(model, WALL)
    q = np.full(model.n, 0.3)
    assert model.gravity.tolist() == FLOOR.tolist()
    on_wall = RobotModel.from_urdf(urdf("iiwa"), gravity=tuple(WALL))
    np.testing.assert_allclose(other.gravity_torque(q), on_wall.gravity_torque(q))
    assert np.abs(other.gravity_torque(q) - model.gravity_torque(q)).max() > 1.0


def described(folder: Path) -> Path:
    (path := folder / "robot.urdf").write_text(urdf("iiwa"))
    return path


def records(r: Recording, names: tuple[str, ...]) -> list[JointStateRecord]:
    empty = np.empty(0)
    return [JointStateRecord(float(t), float(t), names, q, empty, tau) for t, q, tau in zip(r.t, r.q, r.tau, strict=True)]


def test_identify_refuses_it_with_the_cure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = bag(tmp_path / "bag", records(run_of(tuple(CEILING)), robot("iiwa").joint_names))
    assert run(["identify", str(given), "--urdf", str(described(tmp_path)), "--out", str(tmp_path / "model.yaml")]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "mounted otherwise than it is set" in said
    assert "Set the parameter gravity in a file for --config" in said


@pytest.mark.slow
@MOUNTS
def test_it_is_told_with_gravity_and_all_else_is_found_with_it(gravity: FloatArray) -> None:
    level, r = robot("iiwa"), run_of(tuple(gravity))
    found = diagnose(level, [r], [run_of(tuple(gravity), 4)])
    assert found.verdict == "explained"
    (tilt,) = (f for f in found.findings if f.id == "base_tilt")
    assert tilt.of_data
    values = {p.name: p for p in tilt.parameters}
    low, high = np.array(values["gravity"].low), np.array(values["gravity"].high)
    assert np.all(high - low < 0.6)
    across = gravity == 0.0  # along gravity its size is known
    assert np.all(((low < gravity) & (gravity < high))[across])
    told = tilted_gravity(level.gravity, values["roll"].value, values["pitch"].value)
    np.testing.assert_allclose(told, values["gravity"].value, atol=1e-6)
    assert angle_between(told, gravity) < 0.03
    assert "Set the parameter gravity to" in tilt.sentence
    json.dumps(found.as_dict())
    assert found.torque is not None
    assert np.mean(np.array(found.torque.before) / found.torque.after) > 5.0

    # the model says so for the robot on the floor that was given
    assert found.model is not None
    known = TorqueModel(level, [], found.model.known_effects(level))
    for motion in motions(level, r):
        error = known.torques_along(motion).total - motion.tau
        assert np.sqrt(np.mean(error**2)) < 0.15 * np.sqrt(np.mean((motion.link_torque - motion.tau) ** 2))


@pytest.mark.slow
def test_the_files_of_a_robot_on_the_ceiling(tmp_path: Path) -> None:
    given = bag(tmp_path / "bag", records(run_of(tuple(CEILING)), robot("iiwa").joint_names))
    out = tmp_path / "out"
    assert run(["diagnose", str(given), "--urdf", str(described(tmp_path)), "--out", str(out)]) == 0
    document = json.loads((out / "diagnosis.json").read_text())
    (tilt,) = (e for e in document["effects"] if e["name"] == "base_tilt")
    assert tilt["probability"] > 0.99
    assert abs(abs(next(p for p in tilt["parameters"] if p["name"] == "roll")["value"]) - np.pi) < 0.03
    model = ModelFile.read(out / "model.yaml")
    assert [b.effect for b in model.effects].count("base_tilt") == 1
    gravity = ElementTree.parse(out / "extended.xml").find("option")
    assert gravity is not None
    np.testing.assert_allclose([float(x) for x in str(gravity.get("gravity")).split()], CEILING, atol=0.3)
    (settings := tmp_path / "settings.yaml").write_text("/**:\n  ros__parameters:\n    gravity: [0.0, 0.0, 9.81]\n")
    model_out = tmp_path / "model.yaml"
    given_so = ["--urdf", str(described(tmp_path)), "--config", str(settings)]
    assert run(["identify", str(given), *given_so, "--out", str(model_out)]) == 0
    assert ModelFile.read(model_out).effects
