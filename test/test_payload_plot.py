from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.online.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.pages import TruthSegment, check_plot_path, write_payload_plot
from sysid_ros.pages.figure import Mark, keys, with_gaps
from sysid_ros.pages.payload_curves import (
    Quantity,
    event_text,
    inertia_diagonal_jacobian,
    last_known,
    payload_quantities,
    relative_times,
    robust_limits,
    status_spans,
)
from sysid_ros.pages.payload_figure import payload_figure
from sysid_ros.robot import inertial_parameters

JOINTS = ("shoulder", "elbow", "wrist")
COM = np.array([0.03, -0.02, 0.08])
INERTIA = np.diag([0.002, 0.003, 0.004])
START = 1.7e9


def estimate(t: float, mass: float = 1.5, std: float = 0.01, status: str = "ok", observable: bool = True) -> PayloadEstimate:
    scale = std * np.array([1.0] + [0.1] * 3 + [0.02] * 6)
    return PayloadEstimate(
        t=START + t,
        frame="flange",
        theta=inertial_parameters.from_com(mass, COM, INERTIA),
        covariance=np.diag(scale**2),
        status=status,
        reason="",
        observable=np.full(10, observable),
        residual=0.1 * np.sin([t, 2.0 * t, 3.0 * t]),
        payload_effort=np.zeros(3),
    )


def pick_and_drop() -> tuple[list[PayloadEstimate], list[PayloadEvent], list[TruthSegment]]:
    series = [estimate(t, 0.3, 2.0, "warming_up") for t in np.arange(0.0, 2.0, 0.02)]
    series += [estimate(t, 0.0, 0.01, "no_payload") for t in np.arange(2.0, 4.0, 0.02)]
    series += [estimate(t, 1.5, 0.01) for t in np.arange(4.0, 8.0, 0.02)]
    series += [estimate(t, 0.0, 0.01, "no_payload") for t in np.arange(8.0, 10.0, 0.02)]
    events = [PayloadEvent(START + 4.0, "pick", -0.001, 1.5), PayloadEvent(START + 8.0, "drop", 1.5, 0.0)]
    nothing = np.zeros(3), np.zeros((3, 3))
    truth = [
        TruthSegment(START, START + 4.0, 0.0, *nothing),
        TruthSegment(START + 4.0, START + 8.0, 1.5, COM, INERTIA),
        TruthSegment(START + 8.0, START + 10.0, 0.0, *nothing),
    ]
    return series, events, truth


def situations() -> dict[str, tuple[list[PayloadEstimate], list[PayloadEvent], list[TruthSegment] | None]]:
    series, events, truth = pick_and_drop()
    return {
        "pick and drop": (series, events, truth),
        "without truth": (series, events, None),
        "one estimate": ([estimate(0.0)], [], None),
        "mass exactly zero": ([estimate(t, 0.0, 0.02, "no_payload") for t in np.arange(0.0, 1.0, 0.1)], [], None),
        "mass exactly zero, not yet known": ([estimate(t, 0.0, 2.0, "warming_up") for t in np.arange(0.0, 1.0, 0.1)], [], None),
        "negative mass": ([estimate(t, -0.8, 0.02) for t in np.arange(0.0, 1.0, 0.1)], [], None),
        "nothing observable": ([estimate(t, observable=False) for t in np.arange(0.0, 1.0, 0.1)], [], None),
        "a gap": ([estimate(t) for t in (*np.arange(0.0, 1.0, 0.1), *np.arange(30.0, 31.0, 0.1))], [], None),
        "many events": (series, [PayloadEvent(START + 0.1 * k, "change", 1.0, 1.1) for k in range(60)], None),
        "a status and an event of tomorrow": ([estimate(0.0, status="new")], [PayloadEvent(START, "new", 0.0, 1.0)], None),
    }


SITUATIONS = situations()


@pytest.mark.parametrize("name", SITUATIONS)
def test_png_is_written(name: str, tmp_path: Path) -> None:
    series, events, truth = SITUATIONS[name]
    path = tmp_path / "payload.png"
    write_payload_plot(path, series, events, JOINTS, "Payload", truth)
    assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert path.stat().st_size > 5000


@pytest.mark.parametrize(("suffix", "begin"), [(".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_other_formats(suffix: str, begin: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"payload{suffix}"
    write_payload_plot(path, *SITUATIONS["pick and drop"][:2], JOINTS, "Payload")
    assert path.read_bytes().startswith(begin)


@pytest.mark.parametrize("name", SITUATIONS)
def test_page_needs_no_network(name: str, tmp_path: Path) -> None:
    series, events, truth = SITUATIONS[name]
    path = tmp_path / "payload.html"
    write_payload_plot(path, series, events, JOINTS, "Mass < 2 kg & more", truth)
    page = path.read_text(encoding="utf-8")
    assert "<title>Mass &lt; 2 kg &amp; more</title>" in page
    assert len(page) > 1_000_000, "plotly's own code is inside"
    assert not re.findall(r"<(?:script|link|img)\b[^<>]{0,200}\b(?:src|href)\s*=\s*[\"']?https?:", page)


def test_figure_leaves_no_global_state(tmp_path: Path) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    before = pyplot.get_fignums()
    write_payload_plot(tmp_path / "payload.png", [estimate(0.0)], [], JOINTS, "Payload")
    assert pyplot.get_fignums() == before


def test_what_the_figure_says() -> None:
    series, events, truth = pick_and_drop()
    figure = payload_figure(series, events, JOINTS, ("N m", "N m", "N"), "Payload of the arm", truth)
    estimates, residuals = (stack.panels for stack in figure.stacks)
    texts = {item.text for item in estimates[0].items if isinstance(item, Mark)}
    assert texts == {"pick 0.00 → 1.50 kg", "drop 1.50 → 0.00 kg"}
    assert "flange" in figure.subtitle
    assert [p.title for p in estimates] == [
        "Status and events",
        "Mass [kg]",
        "Centre of mass [mm]",
        "Inertia about com [10⁻³ kg m²]",
    ]
    assert [p.title for p in residuals] == ["shoulder [N m]", "elbow [N m]", "wrist [N]"]
    labels = {key.label for key in keys(estimates)}
    assert {"ok", "warming_up", "no_payload", "truth", "95 %", "mass 1.500 ± 0.020", "x 30.0 ± 1.4"} <= labels


def test_the_page_tells_the_numbers_and_the_events(tmp_path: Path) -> None:
    series, events, _ = pick_and_drop()
    write_payload_plot(tmp_path / "payload.html", series, events, JOINTS, "Payload")
    page = (tmp_path / "payload.html").read_text(encoding="utf-8")
    for text in ("1.500 ± 0.020 kg", "30.0, -20.0, 80.0 mm", "<td>pick</td><td>4.00</td><td>-0.001</td><td>1.500</td>"):
        assert text in page


def test_empty_series_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no estimate to plot"):
        write_payload_plot(tmp_path / "payload.png", [], [], JOINTS, "Payload")


def test_wrong_number_of_joints_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"3 joints; 2 names"):
        write_payload_plot(tmp_path / "payload.png", [estimate(0.0)], [], JOINTS[:2], "Payload")


@pytest.mark.parametrize("name", ["payload.jpg", "payload", "payload.csv"])
def test_unknown_suffix_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"must end in \.png"):
        write_payload_plot(tmp_path / name, [estimate(0.0)], [], JOINTS, "Payload")
    assert not (tmp_path / name).exists()


def test_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="does not exist"):
        check_plot_path(tmp_path / "nowhere" / "payload.png")


def test_curves_have_a_gap_where_there_is_no_mass() -> None:
    series, _, truth = pick_and_drop()
    mass, com, inertia = payload_quantities(series, truth)
    carried = np.array([e.status == "ok" for e in series])
    assert np.isfinite(mass.quantities[0].value).all()
    for panel in (com, inertia):
        for curve in panel.quantities:
            np.testing.assert_array_equal(np.isfinite(curve.value), carried)
    np.testing.assert_allclose([c.value[carried][0] for c in com.quantities], 1e3 * COM)
    np.testing.assert_allclose([c.value[carried][0] for c in inertia.quantities], 1e3 * np.diag(INERTIA))
    assert [c.truth[1] for c in com.quantities] == pytest.approx(1e3 * COM)
    assert np.isnan([c.truth[0] for c in com.quantities]).all()


def test_bands_of_the_warm_up_do_not_set_the_limits() -> None:
    estimates, _, truth = pick_and_drop()
    mass = payload_quantities(estimates, truth)[0]
    low, high = mass.limits
    assert -0.5 < low < 0.0
    assert 1.5 < high < 2.0


def test_limits_where_nothing_is_known() -> None:
    nothing = Quantity("x", np.full(3, np.nan), np.full(3, np.nan), ())
    assert robust_limits([nothing], np.ones(3, dtype=bool), 4.0) == (-2.0, 2.0)


def test_inertia_jacobian_is_the_derivative() -> None:
    rng = np.random.default_rng(0)
    theta = inertial_parameters.from_com(2.0, rng.normal(size=3), INERTIA)
    h = 1e-6
    numeric = [
        (np.diag(inertial_parameters.to_com(theta + h * e)[2]) - np.diag(inertial_parameters.to_com(theta - h * e)[2]))
        / (2.0 * h)
        for e in np.eye(10)
    ]
    np.testing.assert_allclose(inertia_diagonal_jacobian(theta), np.array(numeric).T, atol=1e-7)


def test_spans_of_status() -> None:
    series = [estimate(t, status=s) for t, s in ((0.0, "ok"), (0.1, "ok"), (0.2, "stale"), (0.3, "stale"), (9.0, "stale"))]
    spans = status_spans(series)
    assert [(s.status, round(s.start, 2)) for s in spans] == [("ok", 0.0), ("stale", 0.2), ("stale", 9.0)]
    assert spans[0].end == spans[1].start
    assert spans[1].end < 1.0, "a gap has no status"


def test_no_line_crosses_a_gap() -> None:
    t = relative_times([estimate(x) for x in (0.0, 0.1, 5.0, 5.1)])
    x, y = with_gaps(0.5, t, np.arange(4.0))
    np.testing.assert_allclose(y, [0.0, 1.0, np.nan, 2.0, 3.0])
    assert x.size == y.size


def test_numbers_are_not_taken_from_just_after_an_event() -> None:
    series = [estimate(t) for t in np.arange(0.0, 1.01, 0.1)]
    assert last_known(series, []) == 10
    assert last_known(series, [PayloadEvent(START + 0.85, "drop", 1.5, 0.0)]) == 8
    assert last_known([estimate(0.0, status="stale")], []) is None


def test_a_zero_has_no_sign() -> None:
    assert event_text(PayloadEvent(0.0, "pick", -0.001, 1.5)) == "pick 0.00 → 1.50 kg"
