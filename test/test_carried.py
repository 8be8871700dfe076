"""What a replay says was carried: one entry for each thing, with its interval."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_ros.cli.main import run
from sysid_ros.online.carried import carried
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.robot import inertial_parameters

BAGS = Path(__file__).parents[1] / "bags"
TRUTH = json.loads((BAGS / "arm_pick_and_drop.truth.json").read_text())
STD = np.array([0.01] + [1e-3] * 3 + [1e-4] * 6)


def at(t: float, mass: float, status: str = "ok") -> PayloadEstimate:
    """An estimate of something of that mass [kg]."""
    theta = inertial_parameters.from_com(mass, np.array([0.02, 0.0, 0.1]), 0.001 * np.eye(3))
    known = np.ones(10, dtype=bool)
    return PayloadEstimate(t, "tool", theta, np.diag(STD**2), status, "", known, np.zeros(2), np.zeros(2))


def series(*parts: tuple[float, float, float, str]) -> list[PayloadEstimate]:
    """Estimates at 10 Hz: from, to [s], mass [kg], status."""
    return [at(t, mass, status) for start, end, mass, status in parts for t in np.arange(start, end, 0.1)]


def event(t: float, kind: str, before: float, after: float) -> PayloadEvent:
    return PayloadEvent(t, kind, before, after)


EMPTY_THEN_TWO = series((0, 2, 0.0, "no_payload"), (2, 2.5, 1.0, "warming_up"), (2.5, 6, 1.5, "ok"), (6, 8, 0.0, "no_payload"))
EMPTY_THEN_TWO += series((8, 12, 0.7, "ok"))


def test_one_entry_for_each_thing() -> None:
    events = [event(2.0, "pick", 0.0, 1.5), event(6.0, "drop", 1.5, 0.0), event(8.0, "pick", 0.0, 0.7)]
    found = carried(EMPTY_THEN_TWO, events, 12.0)
    assert [(c.t0, c.t1) for c in found] == [(2.0, 6.0), (8.0, 12.0)]
    assert [c.estimate.mass for c in found] == [1.5, 0.7]
    assert all(c.estimate.status == "ok" for c in found)


def test_what_is_carried_from_the_start_counts() -> None:
    found = carried(series((0, 4, 2.0, "ok")), [], 4.0)
    assert [(c.t0, c.t1, c.estimate.mass) for c in found] == [(0.0, 4.0, 2.0)]


def test_forces_that_pass_and_changes_to_the_same_divide_nothing() -> None:
    events = [event(1.0, "external_force", 2.0, 2.0), event(2.0, "change", 2.0, 2.005)]
    found = carried(series((0, 2, 2.0, "ok"), (2, 4, 2.005, "ok")), events, 4.0)
    assert [(c.t0, c.t1) for c in found] == [(0.0, 4.0)]


def test_a_change_to_something_else_divides() -> None:
    found = carried(series((0, 2, 2.0, "ok"), (2, 4, 1.0, "ok")), [event(2.0, "change", 2.0, 1.0)], 4.0)
    assert [c.estimate.mass for c in found] == [2.0, 1.0]


def test_a_thing_that_was_never_believed_says_so() -> None:
    found = carried(series((0, 2, 0.0, "no_payload"), (2, 3, 1.0, "inconsistent")), [event(2.0, "pick", 0.0, 1.0)], 3.0)
    assert [(c.estimate.mass, c.estimate.status) for c in found] == [(1.0, "inconsistent")]


def test_nothing_is_nothing() -> None:
    assert carried([], [], 0.0) == []
    assert carried(series((0, 2, 0.0, "no_payload")), [], 2.0) == []


def test_std_of_the_inertia_is_that_of_drawn_bodies() -> None:
    one = carried(series((0, 1, 2.0, "ok")), [], 1.0)[0]
    drawn = np.random.default_rng(0).multivariate_normal(one.estimate.theta, one.estimate.covariance, 4000)
    spread = np.std([inertial_parameters.to_com(theta)[2] for theta in drawn], axis=0)
    np.testing.assert_allclose(one.inertia_std, spread, rtol=0.06)


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], list[dict[str, str]]]:
    folder = tmp_path_factory.mktemp("carried")
    out = ["--json", str(folder / "out.json"), "--payloads", str(folder / "carried.csv")]
    assert run(["replay", str(BAGS / "arm_pick_and_drop"), *out]) == 0
    with (folder / "carried.csv").open(newline="") as file:
        return json.loads((folder / "out.json").read_text()), list(csv.DictReader(file))


def test_json_has_what_was_carried(replayed: tuple[dict[str, Any], list[dict[str, str]]]) -> None:
    (one,), truth = replayed[0]["payloads"], TRUTH["payload"]
    assert one["t0"] == pytest.approx(TRUTH["pick_time"], abs=0.1)
    assert one["t1"] == pytest.approx(TRUTH["drop_time"], abs=0.1)
    assert one["status"] == "ok"
    assert abs(one["mass"] - truth["theta"][0]) < 1.96 * one["mass_std"]
    assert np.all(np.abs(np.array(one["com"]) - truth["com"]) < 1.96 * np.array(one["com_std"]))
    _, _, inertia = inertial_parameters.to_com(np.array(truth["theta"]))
    assert np.mean(np.abs(np.array(one["inertia_com"]) - inertia) < 1.96 * np.array(one["inertia_com_std"])) > 0.7
    assert np.shape(one["covariance"]) == (10, 10)


def test_csv_has_a_row_a_payload(replayed: tuple[dict[str, Any], list[dict[str, str]]]) -> None:
    document, rows = replayed
    assert [float(r["mass"]) for r in rows] == [p["mass"] for p in document["payloads"]]
    assert float(rows[0]["Ixy_std"]) == pytest.approx(document["payloads"][0]["inertia_com_std"][0][1])


def test_the_answer_comes_first_in_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["replay", str(BAGS / "arm_pick_and_drop")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("Carried in arm_pick_and_drop")
    assert any(re.search(r"1\.(79|80)\d ± 0\.", line) for line in lines[:8])
    assert max(map(len, lines)) <= 80
    assert any(line.startswith("At the end: nothing is carried") for line in lines)
