"""Logs of real robots, kept beside the project: what their owners measured must be found. Skipped where they are not there."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_ros.cli.main import run

DATA = Path(__file__).parents[2] / "shared" / "data"
UR10E = DATA / "ur10e"

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"the measured robot data are not in {DATA}")


def replayed(folder: Path, bag: Path, *arguments: str | Path) -> tuple[dict[str, Any], list[dict[str, str]]]:
    out, series = folder / "out.json", folder / "series.csv"
    assert run(["replay", str(bag), *map(str, arguments), "--json", str(out), "--series", str(series), "--force"]) == 0
    with series.open(newline="") as file:
        return json.loads(out.read_text()), list(csv.DictReader(file))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The UR10e, identified on the two runs in which it carries nothing."""
    path = tmp_path_factory.mktemp("ur10e") / "model.yaml"
    bags = [str(UR10E / name) for name in ("fourier14_noload", "fast20_noload")]
    assert run(["identify", *bags, "--urdf", str(UR10E / "ur10e.urdf"), "--out", str(path)]) == 0
    return path


def with_model(folder: Path, bag: str, model: Path) -> tuple[dict[str, Any], list[dict[str, str]]]:
    return replayed(folder, UR10E / bag, "--urdf", UR10E / "ur10e.urdf", "--model", model)


@pytest.mark.slow
@pytest.mark.parametrize(("bag", "mass", "part"), [("fourier14_load", 2.805, 0.05), ("fast20_load", 1.069, 0.05)])
def test_the_payload_of_a_ur10e(tmp_path: Path, model: Path, bag: str, mass: float, part: float) -> None:
    document, rows = with_model(tmp_path, bag, model)
    payload = document["payload"]
    assert document["status"] == "ok", document["warnings"]
    assert abs(payload["mass"] - mass) < part * mass
    assert abs(payload["mass"] - mass) < 1.96 * payload["mass_std"]
    assert payload["mass_std"] < 0.1 * mass + 0.05  # an interval that says something
    assert not [e for e in document["events"] if e["kind"] == "drop"]
    first = float(rows[0]["t"])
    for row in rows:
        if float(row["t"]) - first < 3.0:
            assert row["status"] in ("warming_up", "not_excited")


@pytest.mark.slow
def test_a_ur10e_without_payload(tmp_path: Path, model: Path) -> None:
    document, _ = with_model(tmp_path, "ptp_noload", model)
    assert document["status"] == "no_payload", document["warnings"]
    assert abs(document["payload"]["mass"]) < 0.15
    assert document["events"] == []


@pytest.mark.slow
@pytest.mark.parametrize("bag", ["fourier14_noload", "fast20_noload"])
def test_the_runs_it_was_identified_on(tmp_path: Path, model: Path, bag: str) -> None:
    document, _ = with_model(tmp_path, bag, model)
    assert document["status"] == "no_payload"
    assert abs(document["payload"]["mass"]) < max(0.15, 1.96 * document["payload"]["mass_std"])


@pytest.mark.slow
@pytest.mark.parametrize("bag", ["ptp_noload", "fourier14_load", "fast20_load", "fourier14_noload"])
def test_the_plain_urdf_is_called_inconsistent(tmp_path: Path, bag: str) -> None:
    document, rows = replayed(tmp_path, UR10E / bag, "--urdf", UR10E / "ur10e.urdf")
    assert document["status"] == "inconsistent"
    assert any("The torques show that" in w for w in document["warnings"])
    assert document["events"] == []
    assert np.mean([r["status"] == "ok" for r in rows]) < 0.05


def identified(folder: Path, *arguments: str | Path) -> dict[str, Any]:
    out = folder / "out.json"
    assert run(["identify", *map(str, arguments), "--out", str(folder / "m.yaml"), "--json", str(out), "--force"]) == 0
    document: dict[str, Any] = json.loads(out.read_text())
    return document


@pytest.mark.slow
@pytest.mark.parametrize("form", ["acceleration", "momentum"])
def test_the_ur10e_held_out_torque_error(tmp_path: Path, form: str) -> None:
    """At 5 Hz, on a run that was not fitted."""
    bags: list[Path | str] = [UR10E / "fourier14_noload", "--validate", UR10E / "fast20_noload", "--urdf", UR10E / "ur10e.urdf"]
    document = identified(tmp_path, *bags, "--cutoff", "5", "--form", form)
    (error,) = document["torque_error"]["validation"]
    assert np.all(np.array(error["relative"]) < [0.09, 0.05, 0.05, 0.07, 0.10, 0.06])
    assert np.all(np.array(error["residual_rms"]) < np.array(error["nominal_residual_rms"]))
    (stamps,) = document["problems"]  # their steps of 9 and 11 ms are of a clock that ticks every 2 ms
    assert stamps["kind"] == "stamps"
    assert "off by 0.18 ms" in stamps["text"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fitted", "judged"),
    [("fourier14_noload", "fast20_noload"), ("fast20_noload", "fourier14_noload"), ("ptp_noload", "fast20_noload")],
)
def test_a_model_is_not_worse_than_the_urdf_with_friction(tmp_path: Path, fitted: str, judged: str) -> None:
    document = identified(tmp_path, UR10E / fitted, "--validate", UR10E / judged, "--urdf", UR10E / "ur10e.urdf")
    (error,) = document["torque_error"]["validation"]
    assert np.all(np.array(error["residual_rms"]) < 1.02 * np.array(error["urdf_friction_residual_rms"]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bags", "words"),
    [
        (["fourier14_noload", "fourier14_load"], "contradict each other"),
        (["fourier14_noload", "fast20_noload", "fast20_load"], "fast20_load contradicts the others"),
        (["friction_joint2"], "hardly move"),
    ],
)
def test_bags_of_a_ur10e_that_do_not_do(tmp_path: Path, capsys: pytest.CaptureFixture[str], bags: list[str], words: str) -> None:
    paths = [str(UR10E / b) for b in bags]
    assert run(["identify", *paths, "--urdf", str(UR10E / "ur10e.urdf"), "--out", str(tmp_path / "m.yaml")]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.slow
def test_currents_of_a_ur10e(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "config.yaml"
    config.write_text(f"effort_scale: {[round(1.0 / g, 6) for g in (11.72, 11.99, 9.82, 10.67, 10.40, 10.69)]}\n")
    arguments = ["--urdf", str(UR10E / "ur10e.urdf"), "--config", str(config), "--out", str(tmp_path / "m.yaml")]
    assert run(["identify", str(UR10E / "fourier14_noload"), *arguments]) == 2
    assert "effort_scale" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("other", ["ur3", "ur5"])
def test_a_urdf_of_another_robot_with_the_same_joint_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], other: str
) -> None:
    description = ur10_description().with_name(f"{other}_robot.urdf")
    if not description.is_file():
        pytest.skip(f"there is no {description}")
    code = run(["identify", str(UR10E / "fourier14_noload"), "--urdf", str(description), "--out", str(tmp_path / "m.yaml")])
    assert code == (2 if other == "ur3" else 0)
    assert "URDF of" in capsys.readouterr().err


def ur10_description() -> Path:
    """Of the package example-robot-data, which pinocchio brings along."""
    pinocchio = pytest.importorskip("pinocchio")
    description = "share/example-robot-data/robots/ur_description/urdf/ur10_robot.urdf"
    found = next((p / description for p in Path(pinocchio.__file__).parents if (p / description).is_file()), None)
    if found is None:
        pytest.skip(f"there is no {description} beside pinocchio")
    return found


def test_a_db3_file_without_metadata(tmp_path: Path) -> None:
    bag = DATA / "unisa_ur10" / "ur10_exciting_trajectory.db3"
    document, rows = replayed(tmp_path, bag, "--urdf", ur10_description())
    assert document["samples"]["used"] > 0.9 * document["samples"]["read"] > 3000
    assert document["duration_s"] == pytest.approx(27.5, abs=1.0)
    assert rows
    assert document["status"] != "ok" or abs(document["payload"]["mass"]) < 1.0  # it carries nothing


def test_a_log_without_velocity(tmp_path: Path) -> None:
    document, rows = replayed(tmp_path, DATA / "staubli_tx40" / "excitation", "--urdf", DATA / "staubli_tx40" / "tx40.urdf")
    assert document["samples"]["used"] > 0.9 * document["samples"]["read"] > 8000
    assert document["duration_s"] == pytest.approx(9.0, abs=0.5)
    assert len(rows) > 300


@pytest.mark.slow
def test_friction_of_a_staubli_is_near_what_was_published(tmp_path: Path) -> None:
    document = identified(tmp_path, DATA / "staubli_tx40" / "excitation", "--urdf", DATA / "staubli_tx40" / "tx40.urdf")
    assert document["problems"] == []
    found = {p["name"]: p for p in document["parameters"]}
    for symbol, published in (("b", [8.05, 5.53, 1.97, 1.11]), ("Fc", [7.14, 8.26, 6.34, 2.48])):
        for joint, value in enumerate(published, start=1):
            p = found[f"{symbol}[joint_{joint}]"]
            assert p["value"] == pytest.approx(value, rel=0.10)
            assert abs(p["value"] - value) < 3.0 * p["std"]


@pytest.mark.slow
def test_a_ur10_raises_no_alarm(tmp_path: Path) -> None:
    bag = DATA / "unisa_ur10" / "ur10_exciting_trajectory.db3"
    document = identified(tmp_path, bag, "--urdf", ur10_description())
    assert document["problems"] == []
