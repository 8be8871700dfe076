"""``sysid identify`` on a bag of the repository: the model it writes, what it prints, and bad input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from robots import urdf

from sysid_ros.cli.main import run
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.model_file import ModelFile, urdf_digest

BAGS = Path(__file__).parents[1] / "bags"
EMPTY = BAGS / "arm_empty"
TRUTH = json.loads((BAGS / "arm_empty.truth.json").read_text())["effects"]


@pytest.fixture(scope="module")
def identified(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("identify")
    model, out = folder / "model.yaml", folder / "out.json"
    assert run(["identify", str(EMPTY), "--validate", str(EMPTY), "--out", str(model), "--json", str(out)]) == 0
    return model, json.loads(out.read_text())


def test_the_model_file_is_as_the_contract_says(identified: tuple[Path, dict[str, Any]]) -> None:
    path, _ = identified
    document = yaml.safe_load(path.read_text())
    assert document["format"] == 1
    assert document["robot"]["name"] == "lbr_iiwa"
    assert len(document["robot"]["joints"]) == 7
    names = [e["effect"] for e in document["effects"]]
    assert names == ["link_inertia", "viscous_friction", "coulomb_friction", "rotor_inertia", "torque_offset"]
    for e in document["effects"]:
        count = len(e["theta"])
        assert len(e["names"]) == len(e["units"]) == count
        assert np.shape(e["covariance"]) == (count, count)
        assert isinstance(e["settings"], dict)
        assert set(e["joints"]) <= set(document["robot"]["joints"])
    assert len(document["noise"]["torque_std"]) == 7
    provenance = document["provenance"]
    assert provenance["bags"] == [str(EMPTY)]
    assert provenance["command"].startswith("sysid ")
    assert provenance["version"]


def test_it_belongs_to_the_urdf_of_the_bag(identified: tuple[Path, dict[str, Any]]) -> None:
    from sysid_ros.sources import BagSource

    file = ModelFile.read(identified[0])
    text = str(BagSource(EMPTY).robot_description)
    assert file.urdf_sha256 == urdf_digest(text)
    assert file.notes(text) == []
    assert len(file.known_effects(RobotModel.from_urdf(text))) == 5


@pytest.mark.parametrize("effect", ["viscous_friction", "coulomb_friction", "torque_offset"])
def test_what_the_bag_hides_is_found(identified: tuple[Path, dict[str, Any]], effect: str) -> None:
    (block,) = [b for b in ModelFile.read(identified[0]).effects if b.effect == effect]
    assert block.covariance is not None
    std = np.sqrt(np.diag(block.covariance))
    assert np.all(np.abs(block.theta - TRUTH[effect]) < 4.0 * std + 0.02)


def test_json(identified: tuple[Path, dict[str, Any]]) -> None:
    _, document = identified
    assert len(document["joints"]) == 7
    assert len(document["parameters"]) == 98
    for p in document["parameters"]:
        assert {"name", "value", "std", "unit", "crb", "ci95", "from_data"} <= set(p)
        assert p["ci95"][0] <= p["value"] <= p["ci95"][1]
    assert 43 <= document["base_parameters"] <= 98
    assert document["condition_number"] > 1
    held_out, validation = document["torque_error"]["held_out"], document["torque_error"]["validation"]
    assert len(held_out) == 2
    assert len(validation) == 1
    for error in (*held_out, *validation):
        assert len(error["residual_rms"]) == len(error["torque_rms"]) == len(error["relative"]) == 7
    assert np.all(np.array(validation[0]["residual_rms"]) < 0.15)


def test_json_holds_the_curves_of_the_report(identified: tuple[Path, dict[str, Any]]) -> None:
    _, document = identified
    assert [r["joint"] for r in document["residuals"]] == document["joints"]
    for r in document["residuals"]:
        for axis in ("position", "velocity", "time"):
            assert len(r[axis]["at"]) == len(r[axis]["residual"]) > 10
            assert r[axis]["at"] == sorted(r[axis]["at"])
        assert len(r["frequency"]["hz"]) == len(r["frequency"]["residual"]) == len(r["frequency"]["torque"]) > 10
    assert len(document["prior"]["links"]) == len(document["prior"]["link_weights"]) == len(document["joints"])


def test_most_messages_rejected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Milliampere in place of N m: hardly a message is believed, and the reason is said."""
    config = tmp_path / "config.yaml"
    config.write_text(f"effort_scale: {[1000.0] * 7}\n")
    arguments = ["--config", str(config), "--out", str(tmp_path / "m.yaml")]
    assert run(["identify", str(EMPTY), *arguments]) == 2
    message = capsys.readouterr().err
    assert "messages were rejected" in message
    assert "effort_scale" in message


def test_the_replay_takes_the_model_and_finds_nothing_carried(identified: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    config, out = tmp_path / "config.yaml", tmp_path / "out.json"
    config.write_text("publish_rate: 5.0\n")
    assert run(["replay", str(EMPTY), "--model", str(identified[0]), "--config", str(config), "--json", str(out)]) == 0
    document = json.loads(out.read_text())
    assert document["status"] == "no_payload"
    assert abs(document["payload"]["mass"]) < 0.15
    assert document["events"] == []
    assert document["warnings"] == []


def test_a_run_in_which_something_is_carried_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["identify", str(EMPTY.parent / "arm_pick_and_drop"), "--out", str(tmp_path / "m.yaml")]
    assert run(arguments) == 2
    said = capsys.readouterr().err
    assert "carries 1.80 kg" in said
    assert "--accept-doubts" in said
    assert not (tmp_path / "m.yaml").exists()
    assert run([*arguments, "--accept-doubts"]) == 0
    assert "carries 1.80 kg" in capsys.readouterr().err


def test_tables_for_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["identify", str(EMPTY), "--out", str(tmp_path / "m.yaml"), "--cutoff", "5"]) == 0
    captured = capsys.readouterr()
    for word in ("Coulomb", "viscous", "offset", "held out", "base parameters"):
        assert word.lower() in captured.out.lower()
    assert "m.yaml" in captured.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "BAG"),
        (["{empty}"], "--out"),
        (["{tmp}/none", "--out", "{tmp}/m.yaml"], "does not exist"),
        (["{empty}", "--out", "{tmp}/no/such/m.yaml"], "no/such"),
        (["{empty}", "--out", "{tmp}/m.yaml", "--urdf", "{tmp}/none.urdf"], "none.urdf"),
        (["{empty}", "--out", "{tmp}/m.yaml", "--urdf", "{tmp}/small.urdf"], "lbr_iiwa_joint_1"),
        (["{empty}", "--out", "{tmp}/m.yaml", "--validate", "{tmp}/none"], "does not exist"),
        (["{empty}", "--out", "{tmp}/m.yaml", "--cutoff", "-1"], "cutoff"),
        (["{empty}", "--out", "{tmp}/m.yaml", "--config", "{tmp}/none.yaml"], "none.yaml"),
        (["{empty}", "--out", "{tmp}/m.yaml", "--topic", "/tf"], "/tf"),
    ],
)
def test_bad_input_is_a_message_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    (tmp_path / "small.urdf").write_text(urdf("small_arm"))
    assert run(["identify", *(a.format(tmp=tmp_path, empty=EMPTY) for a in arguments)]) == 2
    captured = capsys.readouterr()
    assert message in captured.err.replace("\n", " ")
    assert "Traceback" not in captured.err
    assert not (tmp_path / "m.yaml").exists()


def test_a_joint_that_never_moves_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from motions import Motion, measurements
    from robots import robot

    from sysid_ros.sample import JointStateRecord
    from sysid_ros.sources import BagRecorder

    model = robot("small_arm")
    stream = measurements(Motion(model, 1, still=("elbow",)), 10.0, 100.0, [], torque_noise=0.1)
    with BagRecorder(tmp_path / "bag", "mcap") as recorder:
        recorder.write_robot_description(urdf("small_arm"), stream[0].t)
        recorder.write_joint_states([JointStateRecord(m.t, m.t, model.joint_names, m.q, [], m.tau) for m in stream])
    assert run(["identify", str(tmp_path / "bag"), "--out", str(tmp_path / "m.yaml")]) == 2
    assert "elbow" in capsys.readouterr().err


def test_bags_of_different_robots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from motions import Motion, measurements
    from robots import robot

    from sysid_ros.sample import JointStateRecord
    from sysid_ros.sources import BagRecorder

    model = robot("small_arm")
    stream = measurements(Motion(model, 1), 5.0, 100.0, [], torque_noise=0.1)
    with BagRecorder(tmp_path / "bag", "mcap") as recorder:
        recorder.write_robot_description(urdf("small_arm"), stream[0].t)
        recorder.write_joint_states([JointStateRecord(m.t, m.t, model.joint_names, m.q, [], m.tau) for m in stream])
    assert run(["identify", str(EMPTY), str(tmp_path / "bag"), "--out", str(tmp_path / "m.yaml")]) == 2
    assert "same robot" in capsys.readouterr().err
