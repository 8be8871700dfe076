"""The report of an identification: complete, self-contained, small, and safe whatever names a robot has."""

from __future__ import annotations

from dataclasses import replace
from html import escape, unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm_recordings import hidden_parameters, recorded
from html_pages import alone, elements
from robots import robot

from sysid_ros.identification import Choices, Identification, identify_recordings
from sysid_ros.identification.payload_difference import PayloadDifference
from sysid_ros.identification.result import Problem, ResidualSeries
from sysid_ros.pages.identification_page import report_page, write_report
from sysid_ros.pages.page import number
from sysid_ros.pages.residual_curves import class_means, spectrum
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray

ARM = robot("small_arm")
PROVENANCE = {"bags": ["a.mcap", "b.mcap"], "command": "sysid identify 'a & b'", "version": "1.2.3"}


@pytest.fixture(scope="module")
def result() -> Identification:
    truth = hidden_parameters(ARM, 1)
    bags = [recorded(ARM, truth, seed, seconds=12.0, torque_noise=0.05, name=f"bag{seed}.mcap") for seed in (1, 2, 3)]
    return identify_recordings(ARM, bags[:2], bags[2:], PROVENANCE, Choices(prior_weight=1.0))


@pytest.fixture(scope="module")
def page(result: Identification) -> str:
    return report_page(result, PROVENANCE)


def test_a_browser_needs_nothing_else(page: str) -> None:
    found = elements(page)
    assert found.wrong == []
    assert found.open == []
    assert alone(page)
    assert "Plotly" in page


def test_everything_that_was_found_is_there(result: Identification, page: str) -> None:
    text = " ".join(" ".join(elements(page).text).split())
    for name in (*result.joint_names, *result.names):
        assert name in text
    for group in result.groups:
        assert " ".join(group.words.split()) in text
        assert number(group.value) in text
    for sentence in result.record_next:
        assert " ".join(sentence.split()) in text
    for bag in (*PROVENANCE["bags"], "bag3.mcap", PROVENANCE["command"], PROVENANCE["version"], result.prior.reason):
        assert str(bag) in text
    assert page.count('<div class="plot">') == 2
    for title in ("position [", "velocity [", "time [s]", "frequency [Hz]", "[m]", "[rad]"):
        assert title in unescape(page).replace("\\u002f", "/")
    assert "never fitted" in text
    assert "bag1.mcap" in text


def test_names_and_problems_are_only_text(result: Identification) -> None:
    bad = "<script>alert(1)</script>"
    problem = Problem(bag="", joint="", kind="x", text=f"{bad} & more")
    names = tuple(f"{bad}{j}" for j in result.joint_names)
    other = replace(
        result, problems=(problem,), record_next=(bad,), joint_names=names, model=replace(result.model, robot_name=bad)
    )
    page = report_page(other, {"bags": [bad], "command": bad})
    assert bad not in page
    assert escape(f"{bad} & more") in page


@pytest.mark.parametrize("consistent", [True, False])
def test_a_payload_has_its_table(result: Identification, consistent: bool) -> None:
    theta = inertial_parameters.from_com(1.234, np.array([0.01, -0.02, 0.0567]), 0.002 * np.eye(3))
    mass, com, inertia = inertial_parameters.to_com(theta)
    payload = PayloadDifference(
        "tool", theta, 1e-6 * np.eye(10), theta, mass, 0.001, com, np.full(3, 0.002), inertia, 3.0, consistent, np.ones(10)
    )
    text = " ".join(elements(report_page(replace(result, payload=payload), {})).text)
    assert "in the frame of tool" in text
    assert "1.234" in text
    assert "0.0567" in text
    assert ("No body explains" in text) != consistent


def test_one_bag_and_no_validation(result: Identification) -> None:
    alone = replace(
        result,
        validation=(),
        validation_bags=(),
        bags=result.bags[:1],
        repeatability=(),
        record_next=(),
        series=result.series[:1],
    )
    page = report_page(alone, {})
    assert "halves held out in turn" in page
    assert "Repeatability" not in page
    assert elements(page).wrong == []


def test_a_long_recording_of_many_bags_stays_small(result: Identification, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    n, count = 7, 8_000
    names = tuple(f"joint_{k}" for k in range(n))

    def series(k: int) -> ResidualSeries:
        def wide() -> FloatArray:
            return rng.normal(size=(count, n))

        t = 0.02 * np.arange(float(count))
        return ResidualSeries(f"bag{k}", "held out", t, 0.02, wide(), wide(), wide(), wide(), wide(), wide(), wide() > 0.0)

    def seven(values: np.ndarray) -> np.ndarray:
        return np.resize(values, n)

    fields = ("residual", "torque", "nominal", "urdf_friction", "residual_moving", "torque_moving")
    wider: list[dict[str, Any]] = [{f: seven(getattr(e, f)) for f in fields} for e in result.errors]
    errors = tuple(replace(e, **w) for e, w in zip(result.errors, wider, strict=True))
    long = replace(result, joint_names=names, series=tuple(series(k) for k in range(6)), errors=errors, validation=())
    path = tmp_path / "report.html"
    write_report(path, long, PROVENANCE)
    assert path.stat().st_size < 6e6


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, 1e-9, -123456.0])
def test_numbers_for_people(value: float) -> None:
    text = number(value)
    assert text
    assert len(text) <= 10
    if np.isfinite(value):
        assert float(text) == pytest.approx(value, rel=1e-2)


def test_the_spectrum_is_that_of_the_signal() -> None:
    """White noise of density 1, in stretches with gaps between; a line where there is one."""
    rng = np.random.default_rng(0)
    period, count = 0.02, 4000
    t = period * np.arange(float(count))
    t[2000:] += 5.0
    noise = rng.normal(size=count) / np.sqrt(2.0 * period)
    frequency, density = spectrum([noise], [t], period)
    assert np.mean(density) == pytest.approx(1.0, rel=0.1)
    _, line = spectrum([noise + 20.0 * np.sin(2.0 * np.pi * 7.0 * t)], [t], period)
    assert frequency[int(np.argmax(line))] == pytest.approx(7.0, abs=0.3)
    assert spectrum([noise[:5]], [t[:5]], period)[0].size == 0


def test_class_means_follow_the_curve() -> None:
    x = np.random.default_rng(0).uniform(-2.0, 2.0, 2000)
    centre, mean = class_means(x, x**2)
    np.testing.assert_allclose(mean, centre**2, atol=0.05)
    assert class_means(x[:10], x[:10])[0].size == 0
