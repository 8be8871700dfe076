"""model.yaml: what is written comes back, and every damage is answered with the file's name and a cure."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from robots import random_sample, robot, urdf

from sysid_ros.effects import EFFECTS
from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.model_file import EffectBlock, ModelFile, urdf_digest


def example(covariance: bool = True) -> ModelFile:
    model, rng = robot("small_arm"), np.random.default_rng(0)
    blocks = []
    for name in EFFECTS:
        effect = EFFECTS[name](model, () if name == "payload" else ("lift", "slide"))
        root = rng.normal(size=(effect.p, effect.p))
        blocks.append(
            EffectBlock(
                name,
                effect.joint_names,
                effect.settings,
                rng.normal(size=effect.p),
                effect.parameter_names,
                effect.units,
                root @ root.T if covariance else None,
            )
        )
    return ModelFile(
        model.name,
        model.joint_names,
        urdf_digest(model.urdf),
        tuple(blocks),
        np.array([0.1, 1e-12, 3.0, 0.25]),
        np.array([0.5, 0.0, 0.1, 2.0]),
        uncertainty=rng.normal(size=(sum(b.theta.size for b in blocks), 3)) if covariance else None,
        provenance={"bags": ["a/", "b.mcap"], "command": "sysid identify a/ b.mcap", "version": "0.1.0"},
    )


@pytest.mark.parametrize("covariance", [True, False])
def test_what_is_written_comes_back(tmp_path: Path, covariance: bool) -> None:
    written = example(covariance)
    written.write(tmp_path / "model.yaml")
    read = ModelFile.read(tmp_path / "model.yaml")
    for name in ("robot_name", "joints", "urdf_sha256", "provenance"):
        assert getattr(read, name) == getattr(written, name)
    np.testing.assert_array_equal(read.torque_std, written.torque_std)
    np.testing.assert_array_equal(read.correlation_time, written.correlation_time)
    assert (read.uncertainty is None) == (written.uncertainty is None) == (not covariance)
    if read.uncertainty is not None and written.uncertainty is not None:
        np.testing.assert_array_equal(read.uncertainty, written.uncertainty)
    assert len(read.effects) == len(written.effects)
    for a, b in zip(read.effects, written.effects, strict=True):
        assert (a.effect, a.joints, a.settings, a.names, a.units) == (b.effect, b.joints, b.settings, b.names, b.units)
        np.testing.assert_array_equal(a.theta, b.theta)
        assert (a.covariance is None) == (b.covariance is None)
        if a.covariance is not None and b.covariance is not None:
            np.testing.assert_array_equal(a.covariance, b.covariance)


def test_the_layout_of_the_file(tmp_path: Path) -> None:
    """The keys that other programs read, in plain YAML."""
    example().write(tmp_path / "model.yaml")
    document = yaml.safe_load((tmp_path / "model.yaml").read_text())
    assert document["format"] == 1
    assert document["robot"] == {
        "name": "small_arm",
        "joints": ["turn", "lift", "elbow", "slide"],
        "urdf_sha256": urdf_digest(urdf("small_arm")),
    }
    assert [set(e) for e in document["effects"]] == [
        {"effect", "joints", "settings", "theta", "names", "units", "covariance"}
    ] * len(EFFECTS)
    assert document["noise"]["torque_std"] == [0.1, 1e-12, 3.0, 0.25]
    assert {"bags", "command", "version"} <= set(document["provenance"])


def test_its_effects_make_the_torques_that_they_stand_for() -> None:
    model, file = robot("small_arm"), example()
    known = file.known_effects(model)
    sample = random_sample(model, np.random.default_rng(0))
    for block, k in zip(file.effects, known, strict=True):
        assert k.effect.id == block.effect
        assert k.effect.joint_names == block.joints
        expected = EFFECTS[block.effect](model, block.joints, **block.settings).torque(sample, block.theta)
        np.testing.assert_array_equal(k.effect.torque(sample, k.theta), expected)
        assert k.covariance is block.covariance


def test_a_note_where_the_urdf_is_another() -> None:
    file = example()
    assert file.notes(urdf("small_arm")) == []
    (note,) = file.notes(urdf("small_arm").replace("0.3", "0.31"))
    assert "URDF" in note


def test_the_order_of_the_joints_in_the_file_does_not_matter(tmp_path: Path) -> None:
    """Noise is a joint, so it follows the joints by name."""
    example().write(tmp_path / "model.yaml")
    document = yaml.safe_load((tmp_path / "model.yaml").read_text())
    document["robot"]["joints"].reverse()
    for key in ("torque_std", "correlation_time"):
        document["noise"][key].reverse()
    (tmp_path / "model.yaml").write_text(yaml.safe_dump(document))
    file, model = ModelFile.read(tmp_path / "model.yaml"), robot("small_arm")
    file.known_effects(model)
    by_joint = dict(zip(file.joints, file.torque_std, strict=True))
    from sysid_ros.online.free_parameters import FreeParameters
    from sysid_ros.online_settings import OnlineSettings
    from sysid_ros.sample import Measurement

    free = FreeParameters(model, OnlineSettings(), file)
    still = [Measurement(0.01 * k, np.zeros(4), None, np.zeros(4)) for k in range(30)]
    density = free.noise_density(still, 0.01)
    time = dict(zip(file.joints, file.correlation_time, strict=True))
    expected = [max(2.0 * by_joint[j] ** 2 * time[j], 1e-10) for j in model.joint_names]
    np.testing.assert_allclose(density, expected)


Damage = Callable[[dict[str, Any]], Any]


def damaged(change: Damage) -> Damage:
    return change


DAMAGES: dict[str, Damage] = {
    "nothing in it": lambda d: None,
    "a list": lambda d: [1, 2],
    "a word": lambda d: "model",
    "no format": lambda d: d.pop("format") and d,
    "later format": lambda d: d | {"format": 2},
    "no robot": lambda d: d.pop("robot") and d,
    "robot is a word": lambda d: d | {"robot": "iiwa"},
    "no joints": lambda d: d["robot"].pop("joints") and d,
    "joints is a word": lambda d: d["robot"].update(joints="lift") or d,
    "joints is a number": lambda d: d["robot"].update(joints=3) or d,
    "joints are numbers": lambda d: d["robot"].update(joints=[1, 2, 3, 4]) or d,
    "robot has no name": lambda d: d["robot"].pop("name") and d,
    "no effects": lambda d: d.pop("effects") and d,
    "effects is a number": lambda d: d | {"effects": 1},
    "effects is a mapping": lambda d: d | {"effects": {"effect": "payload"}},
    "an effect is a word": lambda d: d | {"effects": ["payload"]},
    "no theta": lambda d: d["effects"][0].pop("theta") and d,
    "theta is a word": lambda d: d["effects"][0].update(theta="many") or d,
    "theta is a number": lambda d: d["effects"][0].update(theta=1.0) or d,
    "theta too short": lambda d: d["effects"][0]["theta"].pop() and d,
    "theta is a table": lambda d: d["effects"][2].update(theta=[[1.0, 2.0]]) or d,
    "theta is ragged": lambda d: d["effects"][2].update(theta=[[1.0], 2.0]) or d,
    "theta not finite": lambda d: d["effects"][2].update(theta=[float("nan"), 1.0]) or d,
    "no names": lambda d: d["effects"][0].pop("names") and d,
    "too few names": lambda d: d["effects"][0]["names"].pop() and d,
    "no units": lambda d: d["effects"][0].pop("units") and d,
    "no effect id": lambda d: d["effects"][0].pop("effect") and d,
    "effect id is a list": lambda d: d["effects"][0].update(effect=["payload"]) or d,
    "effect is unknown": lambda d: d["effects"][0].update(effect="magnetism") or d,
    "joints of an effect": lambda d: d["effects"][0].update(joints=7) or d,
    "unknown joint of an effect": lambda d: d["effects"][2].update(joints=["knee", "lift"]) or d,
    "settings is a word": lambda d: d["effects"][0].update(settings="fast") or d,
    "unknown setting": lambda d: d["effects"][2].update(settings={"size": 1.0}) or d,
    "setting of the wrong type": lambda d: d["effects"][3].update(settings={"width": "narrow"}) or d,
    "setting out of range": lambda d: d["effects"][3].update(settings={"width": 0.0}) or d,
    "unknown frame": lambda d: d["effects"][1].update(settings={"frame": "gripper"}) or d,
    "names of another robot": lambda d: d["effects"][2].update(names=["b[knee]", "b[hip]"]) or d,
    "covariance too small": lambda d: d["effects"][2].update(covariance=[[1.0]]) or d,
    "covariance is a list": lambda d: d["effects"][2].update(covariance=[1.0, 2.0]) or d,
    "covariance not finite": lambda d: d["effects"][2].update(covariance=[[1.0, float("nan")], [0.0, 1.0]]) or d,
    "noise too short": lambda d: d["noise"].update(torque_std=[1.0]) or d,
    "noise is a word": lambda d: d["noise"].update(torque_std="some") or d,
    "noise negative": lambda d: d["noise"].update(torque_std=[-1.0] * 4) or d,
    "noise not finite": lambda d: d["noise"].update(torque_std=[float("inf")] * 4) or d,
    "correlation too short": lambda d: d["noise"].update(correlation_time=[1.0]) or d,
    "correlation not finite": lambda d: d["noise"].update(correlation_time=[float("nan")] * 4) or d,
    "correlation negative": lambda d: d["noise"].update(correlation_time=[-1.0] * 4) or d,
    "noise is no mapping": lambda d: d | {"noise": "none"},
    "provenance is a word": lambda d: d | {"provenance": "none"},
    "uncertainty is a word": lambda d: d | {"uncertainty": "small"},
    "uncertainty lacks directions": lambda d: d | {"uncertainty": {"covariance": [[1.0]]}},
    "uncertainty is a list": lambda d: d["uncertainty"].update(directions=[1.0, 2.0]) or d,
    "uncertainty is ragged": lambda d: d["uncertainty"].update(directions=[[1.0], 2.0]) or d,
    "uncertainty too short": lambda d: d["uncertainty"]["directions"].pop() and d,
    "uncertainty not finite": lambda d: d["uncertainty"]["directions"][0].__setitem__(0, float("nan")) or d,
}


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("model") / "model.yaml"
    example().write(path)
    found: dict[str, Any] = yaml.load(path.read_text(), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return found


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_every_damage_is_named_with_the_file(tmp_path: Path, document: dict[str, Any], damage: Damage) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(yaml.dump(damage(copy.deepcopy(document)), Dumper=getattr(yaml, "CSafeDumper", yaml.SafeDumper)))
    with pytest.raises(ModelFileError) as caught:
        ModelFile.read(path).known_effects(robot("small_arm"))
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    "content",
    [b"\x00\xff\xfe\x80 binary", b"effects: [1, 2", b"a: b: c", b"", b"!!python/object:os.system {}", b"\x89PNG\r\n\x1a\n"],
)
def test_what_is_no_model_at_all(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "model.yaml"
    path.write_bytes(content)
    with pytest.raises(ModelFileError, match=str(path)):
        ModelFile.read(path)


def test_a_file_that_is_not_there_or_is_a_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(ModelFileError, match=f"{path} can't be read"):
            ModelFile.read(path)


def test_missing_noise_is_none(tmp_path: Path) -> None:
    example().write(tmp_path / "model.yaml")
    document = yaml.safe_load((tmp_path / "model.yaml").read_text())
    del document["noise"], document["provenance"]
    (tmp_path / "model.yaml").write_text(yaml.safe_dump(document))
    file = ModelFile.read(tmp_path / "model.yaml")
    np.testing.assert_array_equal(file.torque_std, np.zeros(4))


def test_a_model_of_another_robot(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"turn, lift, elbow, slide.*lbr_iiwa_joint_1"):
        example().known_effects(robot("iiwa"))
    with pytest.raises(ModelFileError, match="joints"):
        example().known_effects(RobotModel.from_urdf(urdf("small_arm"), ("lift", "slide")))
