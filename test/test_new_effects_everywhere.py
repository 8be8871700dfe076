"""Two effects that a test file registers go through every command: hidden, diagnosed, identified, reported and replayed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from test_hidden_at_run_time import JOINT, GearRipple, Wind

from sysid_ros import effects
from sysid_ros.cli.main import sysid
from sysid_ros.simulation.description import arm_description

RIPPLE = {"N": 5.0, "s": 0.24, "c": 0.07}
WIND = {"lift": 2.0, "drag": 3.0}


@pytest.fixture(scope="module", autouse=True)
def registered() -> Iterator[None]:
    for effect in (GearRipple, Wind):
        effects.register(effect)
    yield
    for effect in (GearRipple, Wind):
        del effects.EFFECTS[effect.id]


def run(*arguments: object) -> str:
    result = CliRunner().invoke(sysid, [str(a) for a in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """Two motions of one robot that hides both, and its URDF."""
    folder = tmp_path_factory.mktemp("bags")
    hide = ["--hide", f"{GearRipple.id}@{JOINT}", "--hide", Wind.id]
    values = [x for name, value in {**RIPPLE, **WIND}.items() for x in ("--hide-value", f"{name}={value}")]
    for seed in (1, 2):
        run("simulate", "arm", "--bag", folder / f"run{seed}", *hide, *values, "--seed", seed, "--duration", 20, "--rate", 250)
    (folder / "arm.urdf").write_text(arm_description())
    return folder / "run1", folder / "run2", folder / "arm.urdf"


def carried(model: Path, bag: Path, urdf: Path, out: Path) -> dict[str, Any]:
    run("replay", bag, "--urdf", urdf, "--model", model, "--json", out)
    payload: dict[str, Any] = json.loads(out.read_text())["payload"]
    return payload


@pytest.mark.slow
def test_diagnose_names_them_with_their_sizes_and_its_model_is_taken(bags: tuple[Path, Path, Path], tmp_path: Path) -> None:
    first, second, urdf = bags
    run("diagnose", first, "--validate", second, "--urdf", urdf, "--out", tmp_path / "d")
    document = json.loads((tmp_path / "d" / "diagnosis.json").read_text())
    found = {e["name"]: {p["name"]: p for p in e["parameters"]} for e in document["effects"]}
    assert set(found) == {GearRipple.id, Wind.id}
    for id_, truth in ((GearRipple.id, RIPPLE), (Wind.id, WIND)):
        for name, value in truth.items():
            assert found[id_][name]["value"] == pytest.approx(value, rel=0.1, abs=0.02), (id_, name)
    assert np.mean(document["torque_rmse"]["after"]) < 0.1 * np.mean(document["torque_rmse"]["before"])
    page = (tmp_path / "d" / "report.html").read_text()
    assert GearRipple.label in page.lower()
    model = yaml.safe_load((tmp_path / "d" / "model.yaml").read_text())
    assert {GearRipple.id, Wind.id} <= {block["effect"] for block in model["effects"]}
    payload = carried(tmp_path / "d" / "model.yaml", second, urdf, tmp_path / "replay.json")
    assert abs(payload["mass"]) < 3.0 * payload["mass_std"] + 0.05


@pytest.mark.slow
def test_identify_frees_them_on_request_and_reports_them(bags: tuple[Path, Path, Path], tmp_path: Path) -> None:
    first, second, urdf = bags
    model, report = tmp_path / "model.yaml", tmp_path / "report.html"
    asked = ("--effect", GearRipple.id, "--effect", Wind.id)
    options = ("--urdf", urdf, "--cutoff", 8, "--out", model, "--report", report, "--json", tmp_path / "i.json")
    run("identify", first, second, *asked, *options)
    document = json.loads((tmp_path / "i.json").read_text())
    own = {p["name"]: p for p in document["parameters"] if p["effect"] in (GearRipple.id, Wind.id)}
    assert {f"s[{JOINT}]", f"c[{JOINT}]", "lift", "drag"} == set(own)
    amplitude = np.hypot(own[f"s[{JOINT}]"]["value"], own[f"c[{JOINT}]"]["value"])
    assert amplitude == pytest.approx(np.hypot(RIPPLE["s"], RIPPLE["c"]), rel=0.1)
    assert own["lift"]["value"] == pytest.approx(WIND["lift"], rel=0.1)
    assert own["drag"]["value"] == pytest.approx(WIND["drag"], rel=0.1)
    assert GearRipple.label in report.read_text().lower() or f"s[{JOINT}]" in report.read_text()
    payload = carried(model, second, urdf, tmp_path / "replay.json")
    assert abs(payload["mass"]) < 3.0 * payload["mass_std"] + 0.05
