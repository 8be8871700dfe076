"""Reliability of what is told with a probability: bins, regions, the diagram, the exit code."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the simulation needs PyBullet: pip install 'sysid_ros[sim]'")

from exam.calibration import Bin, main, reliability, table, told


def rows(count: int, lift: float = 0.0, seed: int = 0) -> list[dict[str, Any]]:
    """Robots with two claims each, which are true as often as they say, or by ``lift`` less."""
    rng = np.random.default_rng(seed)
    claims = [[(float(p), bool(rng.uniform() < p - lift)) for p in rng.uniform(0.3, 0.99, 2)] for _ in range(count)]
    return [{"claims": [{"name": "spring", "probability": p, "true": right} for p, right in own]} for own in claims]


def test_each_claim_falls_into_one_bin() -> None:
    pairs = [(0.2, False), (0.5, True), (0.79, False), (0.8, True), (0.95, True), (1.0, True)]
    bins = reliability(pairs)
    assert [(b.count, b.right) for b in bins] == [(2, 1), (1, 1), (2, 2)]
    assert bins[0].mean == pytest.approx(0.645)
    assert bins[0].observed == 0.5


def test_claims_without_a_probability_are_left_out() -> None:
    claims = [{"name": "a", "probability": None, "true": False}, {"name": "b", "probability": 0.9, "true": True}]
    assert told([{"claims": claims}, {"verdict": "error"}]) == [(0.9, True)]


def test_the_region_is_binomial() -> None:
    assert Bin(0.8, 0.95, 100, 90, 0.9).region == (0.84, 0.95)
    assert Bin(0.8, 0.95, 100, 84, 0.9).holds
    assert not Bin(0.8, 0.95, 100, 83, 0.9).holds
    assert Bin(0.5, 0.8, 0, 0, float("nan")).holds
    assert Bin(0.95, 1.0, 3, 3, 1.0).holds
    assert not Bin(0.95, 1.0, 3, 2, 1.0).holds


def test_who_is_calibrated_passes_nineteen_times_in_twenty() -> None:
    passed = [all(b.holds for b in reliability(told(rows(200, seed=seed)))) for seed in range(100)]
    assert sum(passed) >= 80  # three bins of 95 % each
    assert not any(all(b.holds for b in reliability(told(rows(600, 0.15, seed)))) for seed in range(20))


@pytest.mark.parametrize(("lift", "code"), [(0.0, 0), (0.2, 1)])
def test_the_command_draws_and_says_whether_it_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, lift: float, code: int
) -> None:
    files = [tmp_path / name for name in ("a.json", "b.json")]
    for seed, path in enumerate(files, start=3):
        path.write_text(json.dumps(rows(150, lift, seed)))
    picture = tmp_path / "images" / "calibration.png"
    monkeypatch.setattr(sys, "argv", ["calibration", "--json", *map(str, files), "--out", str(picture)])
    assert main() == code
    out = capsys.readouterr().out
    assert picture.stat().st_size > 5000
    assert "300 robots" in out
    assert ("OUTSIDE" in out) is bool(code)


def test_without_a_probability_nothing_is_calibrated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps([{"claims": [{"name": "spring", "probability": None, "true": True}]}]))
    monkeypatch.setattr(sys, "argv", ["calibration", "--json", str(path), "--out", str(tmp_path / "c.png")])
    assert main() == 1
    assert "probability" in capsys.readouterr().out


def test_an_empty_bin_has_a_line() -> None:
    assert len(table(reliability([(0.9, True)])).splitlines()) == 4
