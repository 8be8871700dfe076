"""What ``sysid simulate quadruped --hide`` hides is in the messages or missing in the description, in the truth, and is found."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sysid_ros.exceptions import SettingsError

pytest.importorskip("pybullet", reason="the command needs PyBullet: pip install 'sysid_ros[sim]'")
pytest.importorskip("pybullet_data", reason="PyBullet, which brings the quadruped, is not installed (extra sim)")

from sysid_ros.cli.main import run
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.simulation.hidden_on_legs import Wish, hide_on_legs, hideable_on_legs
from sysid_ros.simulation.quadruped_record import QuadrupedRecord, simulate_quadruped
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario


@cache
def plain() -> QuadrupedRecord:
    return simulate_quadruped(QuadrupedScenario(gait="sway", duration=1.0, seed=3))


def hidden(text: str) -> QuadrupedRecord:
    return hide_on_legs(plain(), [Wish.parse(text)], seed=5)


def mass(record: QuadrupedRecord) -> float:
    return FloatingBase(RobotModel.from_urdf(record.urdf)).mass


def torques(record: QuadrupedRecord) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.stack([x.tau for x in record.measured])


def test_everything_that_is_looked_for_on_legs_can_be_hidden_and_is_in_the_truth() -> None:
    for name in hideable_on_legs():
        found = hidden(name)
        (told,) = found.truth["effects"]
        assert told["name"] == name
        assert told["parameters"]
        assert all(np.any(np.abs(p["value"]) > 0.0) for p in told["parameters"])
        json.dumps(found.truth)
        same_messages = all(
            np.array_equal(a.tau, b.tau) and np.array_equal(a.specific_force, b.specific_force)
            for a, b in zip(found.measured, plain().measured, strict=True)
        )
        assert same_messages != (found.urdf == plain().urdf)
        again = hidden(name)
        assert again.truth == found.truth
    assert plain().truth.get("effects") is None


def test_torques_and_imu_are_as_the_size_says() -> None:
    joint = plain().truth["joint_names"][4]
    gained = torques(hidden(f"torque_scale@{joint}=0.25"))
    np.testing.assert_allclose(gained[:, 4], 1.25 * torques(plain())[:, 4])
    np.testing.assert_array_equal(np.delete(gained, 4, axis=1), np.delete(torques(plain()), 4, axis=1))
    rubbed = torques(hidden("viscous_friction=0.2")) - torques(plain())
    np.testing.assert_allclose(rubbed, 0.2 * np.stack([x.v for x in plain().exact]), atol=1e-12)
    turned = hidden("imu_tilt=0.03")
    tilt = np.array([p["value"] for p in turned.truth["effects"][0]["parameters"]])
    np.testing.assert_allclose(np.abs(tilt), 0.03)
    back = TrunkSetup(tilt=tilt).corrected(np.stack([x.specific_force for x in turned.measured]))
    np.testing.assert_allclose(back, np.stack([x.specific_force for x in plain().measured]), atol=1e-9)


def test_links_bodies_and_feet_are_missing_in_the_description() -> None:
    assert mass(plain()) - mass(hidden("payload=1.5")) == pytest.approx(1.5)
    assert mass(plain()) > mass(hidden("link_inertia=0.5")) > 0.8 * mass(plain())
    trunk = hidden("link_inertia@trunk=0.1")
    own = FloatingBase(RobotModel.from_urdf(plain().urdf)).robot.pi[50:60]
    said = FloatingBase(RobotModel.from_urdf(trunk.urdf)).robot.pi[50:60]
    # heavier than said by a tenth, with what is fixed to it
    np.testing.assert_allclose(1.1 * said, own, rtol=1e-6, atol=1e-9)
    spheres = [
        [float(x.get("radius", "0")) for x in ElementTree.fromstring(r.urdf).iter("sphere")]
        for r in (plain(), hidden("foot_radius=0.01"))
    ]
    assert sum(np.isclose(a - b, 0.01) for a, b in zip(*spheres, strict=True)) == 4


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("gravity", "it must be one of"),
        ("torque_scale@nose", "the joint must be one of"),
        ("imu_tilt@FL_hip_joint", "left out"),
        ("imu_tilt=much", "the size must be a number"),
        ("imu_tilt=nan", "finite"),
        ("foot_radius=0.5", "no sphere so large"),
        ("payload=50", "weighs less"),
    ],
)
def test_what_cannot_be_hidden_is_refused(text: str, says: str) -> None:
    with pytest.raises(SettingsError, match=says):
        hidden(text)


@pytest.mark.slow
@pytest.mark.parametrize("simulator", ["pybullet", "mujoco"])
@pytest.mark.parametrize("hides", ["coulomb_friction=0.4", "imu_tilt=0.04", "torque_offset=0.8"])
def test_what_is_hidden_by_the_command_is_found_by_the_command(tmp_path: Path, simulator: str, hides: str) -> None:
    more = []
    if simulator == "mujoco":
        pytest.importorskip("mujoco", reason="MuJoCo is not installed (extra mujoco)")
        if packaged("go2") is None:
            pytest.skip("example-robot-data is not installed (extra dev)")
        more = ["--simulator", "mujoco", "--robot", "go2"]
    bag, out = tmp_path / "bag", tmp_path / "diagnosis"
    name = hides.partition("=")[0]
    asked = ["--bag", str(bag), "--gait", "sway", "--extent", "1.4", "--duration", "20", "--seed", "21", "--hide", hides, *more]
    assert run(["simulate", "quadruped", *asked]) == 0
    truth = json.loads((tmp_path / "bag.truth.json").read_text())
    assert [e["name"] for e in truth["effects"]] == [name]
    assert run(["diagnose", str(bag), "--out", str(out)]) == 0
    causes = json.loads((out / "diagnosis.json").read_text())["effects"]
    assert causes[0]["name"] == name
    assert set(causes[0]["joints"]) >= set(truth["effects"][0]["joints"])
