"""``sysid control``: the laws side by side on the simulated arm, and bad input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install '.[sim]'")

from sysid_ros.cli.main import run

QUICK = ["--duration", "10", "--pick", "5.5", "--drop", "9"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("control")


@pytest.fixture(scope="module")
def done(folder: Path) -> dict[str, dict[str, Any]]:
    """The laws of a run by their names; a seed that nothing was set on."""
    assert run(["control", "--seed", "17", *QUICK, "--json", str(folder / "out.json"), "--plot", str(folder / "out.png")]) == 0
    document = json.loads((folder / "out.json").read_text())
    assert document["scenario"]["seed"] == 17
    return {law["law"]: law for law in document["laws"]}


def tip(law: dict[str, Any], phase: str) -> float:
    return float(law["phases"][phase]["tip_rms_m"])


@pytest.mark.slow
def test_empty_all_laws_follow_alike(done: dict[str, dict[str, Any]]) -> None:
    errors = [tip(law, "empty") for law in done.values()]
    assert max(errors) < 2.0 * min(errors) < 1e-3


@pytest.mark.slow
def test_a_law_that_learns_beats_one_that_does_not(done: dict[str, dict[str, Any]]) -> None:
    blind = tip(done["computed_torque"], "carrying")
    assert blind > 2e-3
    assert tip(done["slotine_li"], "carrying") < 0.5 * blind
    assert tip(done["composite"], "carrying") < 0.2 * blind
    assert tip(done["certainty_equivalence"], "carrying") < 0.9 * blind
    assert tip(done["informed"], "carrying") < 0.1 * blind
    assert tip(done["composite"], "just_picked_up") < tip(done["certainty_equivalence"], "just_picked_up")


@pytest.mark.slow
def test_the_masses_that_are_believed_in(done: dict[str, dict[str, Any]]) -> None:
    assert done["computed_torque"]["mass_while_carrying"] == 0.0
    assert done["composite"]["mass_while_carrying"] == pytest.approx(3.0, rel=0.05)
    assert done["slotine_li"]["mass_while_carrying"] == pytest.approx(3.0, rel=0.2)
    assert all(law["lost_at_s"] is None and law["steps_at_effort_limit"] == 0 for law in done.values())


@pytest.mark.slow
def test_the_figure_is_there(folder: Path, done: dict[str, dict[str, Any]]) -> None:
    assert (folder / "out.png").stat().st_size > 20_000


def test_a_page_holds_all_it_needs(folder: Path) -> None:
    page = folder / "out.html"
    arguments = ["--law", "computed_torque", "slotine_li", "--duration", "2", "--pick", "0.5", "--drop", "1.5"]
    assert run(["control", *arguments, "--plot", str(page)]) == 0
    assert "Slotine-Li" in page.read_text()


def test_a_law_that_loses_the_motion_is_said_to(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "lost.json"
    arguments = ["--law", "computed_torque", "--bandwidth", "2", "--payload-mass", "15", *QUICK]
    assert run(["control", *arguments, "--json", str(out)]) == 0
    (law,) = json.loads(out.read_text())["laws"]
    assert law["lost_at_s"] > 5.5
    assert "carrying" not in law["phases"]
    assert "lost the motion" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--law", "pid"], "computed_torque"),
        (["--bandwidth", "0"], "--bandwidth is 0"),
        (["--pick", "20"], "--pick"),
        (["--duration", "inf"], "--duration is inf"),
        (["--plot", "figure.jpeg"], ".png"),
        (["--json", "nowhere/out.json"], "nowhere"),
        (["--coulomb-friction", "1,2"], "--coulomb-friction"),
        (["--model", "nothing.yaml"], "nothing.yaml"),
    ],
)
def test_bad_input_is_named(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["control", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_data_enabled_control_of_one_joint_has_a_table_of_its_own(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "joint.json"
    assert run(["control", "--law", "deepc", "--duration", "3", "--seed", "2", "--json", str(out)]) == 0
    laws = {x["law"]: x["rms_rad"] for x in json.loads(out.read_text())["joint_with_friction"]}
    assert laws["deepc"] < laws["computed_torque"] < 0.1
    assert run(["control", "--law", "deepc", "--law", "composite"]) == 2
    assert "--law deepc" in capsys.readouterr().err
