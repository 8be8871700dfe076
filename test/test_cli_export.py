"""``sysid export`` and ``sysid doctor``."""

from __future__ import annotations

import csv
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from sysid_ros.cli.main import run
from sysid_ros.effects import CoulombFriction, LinkInertia, RotorInertia, ViscousFriction
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sources import BagSource
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest

BAG = Path(__file__).parents[1] / "bags" / "arm_empty"


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, RobotModel]:
    """model.yaml, URDF and robot."""
    folder = tmp_path_factory.mktemp("export")
    text = BagSource(BAG).robot_description or ""
    (folder / "arm.urdf").write_text(text)
    robot = RobotModel.from_urdf(text)
    known = [
        KnownEffect(LinkInertia(robot), 1.02 * robot.pi),
        KnownEffect(RotorInertia(robot), np.linspace(0.1, 0.7, robot.n)),
        KnownEffect(ViscousFriction(robot), np.linspace(1.0, 2.0, robot.n)),
        KnownEffect(CoulombFriction(robot), np.linspace(0.5, 1.5, robot.n)),
    ]
    blocks = [
        EffectBlock(k.effect.id, robot.joint_names, k.effect.settings, k.theta, k.effect.parameter_names, k.effect.units, None)
        for k in known
    ]
    nothing = np.zeros(robot.n)
    found = ModelFile(robot.name, robot.joint_names, urdf_digest(text), tuple(blocks), nothing, nothing)
    found.write(folder / "model.yaml")
    return folder / "model.yaml", folder / "arm.urdf", robot


def test_a_model_is_written_for_each_simulator(
    model: tuple[Path, Path, RobotModel], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, urdf, robot = model
    outs = [tmp_path / name for name in ("arm.xml", "arm.urdf", "joints.csv")]
    assert run(["export", str(path), "--urdf", str(urdf), "--out", *map(str, outs)]) == 0
    captured = capsys.readouterr()
    assert "armature" in captured.out
    assert "A URDF can't hold rotor_inertia" in captured.err
    with outs[2].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [r["joint"] for r in rows] == list(robot.joint_names)
    np.testing.assert_allclose([float(r["armature"]) for r in rows], np.linspace(0.1, 0.7, robot.n))
    np.testing.assert_allclose([float(r["friction"]) for r in rows], np.linspace(0.5, 1.5, robot.n))
    again = RobotModel.from_urdf(outs[1].read_text())
    np.testing.assert_allclose(again.pi, 1.02 * robot.pi, atol=1e-9)


def test_mujoco_gives_the_torques_of_the_model(model: tuple[Path, Path, RobotModel], tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed (extra mujoco)")
    path, urdf, robot = model
    out = tmp_path / "arm.xml"
    assert run(["export", str(path), "--urdf", str(urdf), "--out", str(out)]) == 0
    theirs = mujoco.MjModel.from_xml_path(str(out))
    theirs.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    theirs.dof_frictionloss[:] = 0.0
    data, rng = mujoco.MjData(theirs), np.random.default_rng(0)
    for _ in range(100):
        q, v, a = rng.uniform(-1.5, 1.5, (3, robot.n))
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(theirs, data)
        rotor, viscous = np.linspace(0.1, 0.7, robot.n) * a, np.linspace(1.0, 2.0, robot.n) * v
        np.testing.assert_allclose(data.qfrc_inverse, 1.02 * robot.rnea(q, v, a) + rotor + viscous, rtol=1e-6, atol=1e-6)


def test_what_is_there_is_not_overwritten(
    model: tuple[Path, Path, RobotModel], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, urdf, _ = model
    out = tmp_path / "arm.xml"
    out.write_text("mine")
    arguments = ["export", str(path), "--urdf", str(urdf), "--out", str(out)]
    assert run(arguments) == 2
    assert "not overwritten" in capsys.readouterr().err
    assert out.read_text() == "mine"
    assert run([*arguments, "--force"]) == 0
    assert out.read_text().startswith("<mujoco")


@pytest.mark.parametrize(
    ("out", "word"), [("arm.stl", "must be one of"), ("no/arm.xml", "does not exist")], ids=["suffix", "folder"]
)
def test_bad_outputs(
    model: tuple[Path, Path, RobotModel], out: str, word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, urdf, _ = model
    assert run(["export", str(path), "--urdf", str(urdf), "--out", str(tmp_path / out)]) == 2
    assert word in capsys.readouterr().err


def test_doctor_tells_what_works(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor", "--json", str(tmp_path / "d.json")]) == 0
    said = capsys.readouterr().out
    assert "What is needed works." in said
    document = json.loads((tmp_path / "d.json").read_text())
    assert document["installed"]["pinocchio"]
    assert set(document["tried"].values()) == {None}


def test_doctor_says_what_to_do(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name in ("pyarrow", "cvxpy") else find(name))
    assert run(["doctor"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "pip install 'sysid_ros[tables]'" in said
    assert "Something that is needed does not work" in said
