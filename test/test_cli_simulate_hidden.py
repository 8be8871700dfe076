"""``sysid simulate arm --hide``: the bag, its truth, sizes that are given and sizes that are drawn."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from sysid_ros.cli.simulate import command
from sysid_ros.exceptions import SysidError
from sysid_ros.sources import BagSource

JOINT = "lbr_iiwa_joint_4"


def simulate(bag: Path, *arguments: str) -> dict[str, Any]:
    options = ["arm", "--bag", str(bag), "--duration", "8", "--rate", "100", *arguments]
    result = CliRunner().invoke(command, options, catch_exceptions=False)
    assert result.exit_code == 0
    truth: dict[str, Any] = json.loads(bag.with_name(f"{bag.name}.truth.json").read_text())
    return truth


def test_bag_and_truth_are_written(tmp_path: Path) -> None:
    summary = tmp_path / "out.json"
    truth = simulate(tmp_path / "a", "--hide", f"coulomb_friction@{JOINT}", "--hide-value", "Fc=2.5", "--json", str(summary))
    (effect,) = truth["effects"]
    assert (effect["name"], effect["joints"]) == ("coulomb_friction", [JOINT])
    assert effect["parameters"] == [{"name": "Fc", "joint": JOINT, "value": 2.5, "unit": "N m"}]
    source = BagSource(tmp_path / "a")
    records = list(source)
    assert source.robot_description is not None
    assert len(records) == 800
    assert records[0].stamp == truth["start_time"]
    assert list(records[0].names) == truth["joint_names"]
    assert json.loads(summary.read_text())["truth"] == truth
    with pytest.raises(SysidError, match="exists already"):
        simulate(tmp_path / "a", "--hide", "coulomb_friction")


@pytest.mark.slow
def test_another_seed_moves_the_same_robot_otherwise(tmp_path: Path) -> None:
    hidden = ("--hide", "payload", "--hide", "viscous_friction", "--hide-seed", "3", "--no-velocity")
    one, other = simulate(tmp_path / "a", *hidden), simulate(tmp_path / "b", *hidden, "--seed", "1")
    assert one["effects"] == other["effects"]
    first, second = (list(BagSource(tmp_path / name)) for name in "ab")
    assert not np.allclose(first[400].position, second[400].position)
    assert len(first[0].velocity) == 0
    drawn_again = simulate(tmp_path / "c", "--hide", "payload", "--hide", "viscous_friction", "--hide-seed", "4")
    assert drawn_again["effects"] != one["effects"]


def test_what_pybullet_can_not_step_is_simulated_all_the_same(tmp_path: Path) -> None:
    assert simulate(tmp_path / "a", "--hide", f"joint_elasticity@{JOINT}")["simulator"] == "compiled"
    assert simulate(tmp_path / "b", "--hide", "base_tilt", "--hide-value", "roll=0.05")["simulator"] == "pybullet"


def test_what_stays_below_the_noise_is_said(tmp_path: Path) -> None:
    def told(bag: str, level: str) -> tuple[str, float]:
        hidden = ["--hide", f"coulomb_friction@{JOINT}", "--hide-value", f"Fc={level}"]
        options = ["arm", "--bag", str(tmp_path / bag), "--duration", "8", "--rate", "100", *hidden]
        result = CliRunner().invoke(command, options, catch_exceptions=False)
        truth = json.loads((tmp_path / f"{bag}.truth.json").read_text())
        return result.output.replace("\n", " "), max(truth["residual_over_noise"])

    (small, of_small), (large, of_large) = told("small", "0.02"), told("large", "4")
    assert of_small < 4.0 < of_large
    assert "hardly anyone can find it" in small
    assert "hardly" not in large


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--hide", "gremlins"), "gremlins.*must be one of.*coulomb_friction"),
        (("--hide", "coulomb_friction@elbow"), "elbow.*must be one of.*lbr_iiwa_joint_1"),
        (("--hide", f"base_tilt@{JOINT}"), "can't be hidden on that joint"),
        (("--hide", "coulomb_friction", "--hide-value", "Fc=much"), "--hide-value is 'Fc=much'"),
        (("--hide", "coulomb_friction", "--hide-value", "b=1"), "what is hidden has.*Fc"),
        (("--hide", "payload", "--hide-value", "com=0.1"), "com.*3 numbers"),
        (("--hide", "payload", "--duration", "3"), "--duration is 3.0 s"),
        (("--hide", "payload", "--rate", "333"), "rate.*divisor"),
        (("--hide", "payload", "--torque-noise", "-1"), "--torque-noise is -1.0"),
        (("--hide", "payload", "--hide-seed", "-1"), "--hide-seed is -1"),
        (("--hide", "payload", "--pick", "2"), "--pick is given beside --hide"),
        (("--hide", "external_force", "--hide-value", "force=0,0,5000"), "Hide something smaller"),
    ],
)
def test_bad_input_is_named_and_leaves_nothing(arguments: tuple[str, ...], says: str, tmp_path: Path) -> None:
    with pytest.raises(SysidError, match=says):
        simulate(tmp_path / "a", *arguments)
    assert list(tmp_path.iterdir()) == []
