"""``sysid simulate``: the bag, the truth beside it, the messages about bad input, and the bags that are kept."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from sysid_ros.cli.simulate import command
from sysid_ros.exceptions import SysidError
from sysid_ros.robot.inertial_parameters import to_com
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.simulation.arm_record import truth_path
from sysid_ros.simulation.description import arm_description
from sysid_ros.sources import BagSource


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_command_writes_bag_truth_and_json(tmp_path: Path, storage: str) -> None:
    bag, summary = tmp_path / "out", tmp_path / "out.json"
    arguments = ["arm", "--bag", str(bag), "--storage", storage, "--duration", "2", "--rate", "250", "--no-velocity"]
    arguments += ["--payload-mass", "1", "--pick", "1", "--json", str(summary)]
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    source = BagSource(bag)
    records = list(source)
    assert source.robot_description == arm_description()
    assert len(records) == 500
    truth = json.loads((tmp_path / "out.truth.json").read_text())
    assert records[0].names == tuple(truth["joint_names"])
    assert records[0].stamp == truth["start_time"]
    assert len(records[0].velocity) == 0
    assert truth["pick_time"] == records[250].stamp
    assert truth["drop_time"] is None
    assert json.loads(summary.read_text())["truth"] == truth
    with pytest.raises(SysidError, match="exists already"):
        CliRunner().invoke(command, arguments, catch_exceptions=False)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        (["--payload-mass", "-1"], "--payload-mass is -1"),
        (["--payload-mass", "1", "--pick", "20"], "--pick is 20"),
        (["--payload-mass", "1", "--pick", "5", "--drop", "4"], "--drop is 4"),
        (["--viscous-friction", "1,2"], "--viscous-friction"),
        (["--duration", "inf"], "--duration is inf"),
    ],
)
def test_command_names_the_option_and_leaves_nothing_behind(tmp_path: Path, arguments: list[str], match: str) -> None:
    with pytest.raises(SysidError, match=match):
        CliRunner().invoke(command, ["arm", "--bag", str(tmp_path / "out"), *arguments], catch_exceptions=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [["--storage", "rosbag1"], ["--viscous-friction", "much"], []])
def test_command_rejects_bad_usage(tmp_path: Path, arguments: list[str]) -> None:
    given = ["arm", "--bag", str(tmp_path / "out"), *arguments] if arguments else ["arm"]
    assert CliRunner().invoke(command, given).exit_code == 2


@pytest.mark.parametrize("name", ["arm_pick_and_drop", "arm_empty"])
def test_kept_bags_fit_their_truth(name: str) -> None:
    bag = Path(__file__).parents[1] / "bags" / name
    truth = json.loads(truth_path(bag).read_text())
    source = BagSource(bag)
    records = list(source)
    assert sum(f.stat().st_size for f in bag.iterdir()) < 2_000_000
    assert records[0].stamp == truth["start_time"]
    assert len(records) == truth["duration"] * truth["rate"]
    assert records[0].names == RobotModel.from_urdf(str(source.robot_description)).joint_names == tuple(truth["joint_names"])
    assert (len(records[0].velocity) == 7) == (truth["noise"]["velocity"] is not None)
    if truth["payload"] is not None:
        mass, com, _ = to_com(np.array(truth["payload"]["theta"]))
        assert mass == pytest.approx(truth["payload"]["mass"])
        assert com == pytest.approx(truth["payload"]["com"])
