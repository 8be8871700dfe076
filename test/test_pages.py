"""Every figure, drawn by both renderers, shows each curve and label; every page is well formed, alone, and escapes names."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from html import escape
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from html_pages import alone, elements
from matplotlib.text import Text
from test_payload_plot import pick_and_drop

from sysid_ros.control.tracking_run import TrackingRun
from sysid_ros.diagnosis.gain import SimulationError, Tracking
from sysid_ros.diagnosis.result import Diagnosis, Finding, Predictions, TorqueRmse
from sysid_ros.effects import Parameter
from sysid_ros.excitation.excite import Excitation
from sysid_ros.frequency_domain import FrequencyCheck
from sysid_ros.identification.result import ResidualSeries
from sysid_ros.pages import diagnosis_figures, identification_figures, write_payload_plot, write_plot
from sysid_ros.pages.diagnosis_page import diagnosis_page
from sysid_ros.pages.excitation_figure import excitation_figure, write_excitation
from sysid_ros.pages.figure import Axis, Band, Cells, Curve, Figure, Mark, Panel, Spans, Stack, keys, legends, peaks
from sysid_ros.pages.frequency_figure import frequency_figure, write_frequency_plot
from sysid_ros.pages.layout import places
from sysid_ros.pages.matplotlib_renderer import drawn
from sysid_ros.pages.page import page
from sysid_ros.pages.payload_figure import payload_figure
from sysid_ros.pages.plotly_renderer import WIDTHS, specification
from sysid_ros.pages.robot_view import Track, ellipsoid, view
from sysid_ros.pages.tracking_figure import Followed, tracking_figure, write_tracking
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.postures import Postures

BAD = '_<b>x</b>&"$a$</script><script>alert(1)</script>'
NAMES = (f"{BAD}0", f"{BAD}1", "wrist")
UNITS = ("N m", "N m", "N")
N = 240
T: FloatArray = 0.05 * np.arange(N, dtype=float)
RNG = np.random.default_rng(0)


def wide() -> np.ndarray:
    return RNG.normal(size=(N, 3))


@cache
def arm() -> RobotModel:
    """Two turns and a slide, of bodies of three shapes."""
    shapes = ('<box size="0.1 0.1 0.4"/>', '<cylinder radius="0.05" length="0.5"/>', '<sphere radius="0.06"/>')
    inertial = '<inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
    parts = ['<link name="base"/>']
    for k, (name, shape) in enumerate(zip(NAMES, shapes, strict=True)):
        kind, parent = "revolute" if k < 2 else "prismatic", f"link {k - 1}" if k else "base"
        parts.append(
            f'<link name="link {k}">{inertial}<visual><origin xyz="0 0 0.2"/><geometry>{shape}</geometry></visual></link>'
        )
        parts.append(
            f'<joint name="{escape(name)}" type="{kind}"><parent link="{parent}"/><child link="link {k}"/>'
            f'<origin xyz="0 0 {0.4 * (k > 0)}"/>'
            f'<axis xyz="0 {int(k == 1)} {int(k != 1)}"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
        )
    return RobotModel.from_urdf(f'<robot name="{escape(BAD)}">{"".join(parts)}</robot>')


def postures() -> FloatArray:
    return np.column_stack([np.sin(T), np.cos(2.0 * T), 0.1 * np.sin(3.0 * T)])


def runs() -> list[TrackingRun]:
    laws = (BAD, "slotine_li")
    return [TrackingRun(law, T, wide(), np.abs(wide()[:, 0]), wide()[:, 1], wide(), 0, None, (), postures()) for law in laws]


EVENTS = ((3.0, "pick"), (8.0, "drop"))


def excitation() -> Excitation:
    limits = SimpleNamespace(
        robot=arm(),
        effort=np.array([10.0, 20.0, np.inf]),
        torque=lambda q, v, a: q,
        use=lambda *given: np.stack([np.clip(x, -1.0, 1.0) for x in given]),
    )
    trajectory = SimpleNamespace(duration=10.0, sample=lambda t: (np.outer(np.sin(t), [1, 2, 3]),) * 3, grid=lambda _: T)
    criteria = SimpleNamespace(d=-3.0, condition_number=12.0)
    random = tuple(SimpleNamespace(d=d) for d in (-5.0, -9.0, -np.inf))
    use = SimpleNamespace(limits=np.linspace(0.0, 1.0, 12).reshape(4, 3), room=np.array([0.01]))
    found = SimpleNamespace(
        trajectory=trajectory, limits=limits, criteria=criteria, random=random, use=use, pairs=((BAD, "link"),)
    )
    return cast(Excitation, found)


def frequency() -> FrequencyCheck:
    windows = [
        SimpleNamespace(f=f, high=1.2 * f, H=0.9 + 0.1j * f, radius=0.1 * f, clear=k != 3, coherence=0.8)
        for k, f in enumerate((0.2, 0.5, 1.0, 2.0, 4.0))
    ]
    delay = SimpleNamespace(name="delay", value=0.003, unit="s")
    cause = SimpleNamespace(named=True, band=(0.2, 4.0), H=lambda f: np.exp(-0.02j * f), name="time_delay", parameters=[delay])
    bands = [
        SimpleNamespace(low=a, high=b, says=says, H=1.02 + 0.1j, radius=0.05 * b)
        for a, b, says in ((0.1, 1, "holds"), (1, 2, "untold"), (2, 9, "fails"))
    ]
    response = SimpleNamespace(windows=windows, cause=cause, verdict=SimpleNamespace(bands=bands, holds_to=1.0, fails_from=2.0))
    joints = tuple(SimpleNamespace(joint=name, torque=response, friction=None, sentences=(f"{name}: holds",)) for name in NAMES)
    return cast(FrequencyCheck, SimpleNamespace(joints=joints, sentences=(BAD,), postures=Postures(T, postures())))


def series() -> list[ResidualSeries]:
    gap: FloatArray = np.asarray(T + np.where(np.arange(N) > 100, 3.0, 0.0), dtype=float)
    return [
        ResidualSeries(f"bag{k}", "held out", gap, 0.05, wide(), wide(), wide(), wide(), wide(), wide(), wide() > 0.0)
        for k in range(2)
    ]


def predictions(warm: bool = True) -> Predictions:
    temperature = np.column_stack([T, np.full((N, 2), np.nan)]) if warm else None
    return Predictions(T, NAMES, wide(), wide(), wide(), postures(), wide(), wide(), temperature)


def tracking_error() -> Tracking:
    t = np.concatenate([np.append(0.01 * np.arange(50) + k, np.nan) for k in range(4)])
    before, after, perfect = (np.where(np.isnan(t)[:, None], np.nan, RNG.normal(size=(len(t), 3))) for _ in range(3))
    return Tracking(t, NAMES, before, after, perfect)


def diagnosis() -> Diagnosis:
    vector = Parameter("com", None, [0.1, 0.2, 0.3], "m", [0.1] * 3, [0.0, 0.1, 0.2], [0.2, 0.3, 0.4])
    mass = Parameter("mass", None, 1.2, "kg", 0.1, 1.0, 1.4)
    plain = Parameter("Fc", NAMES[0], 0.6, "N m", 0.01, 0.58, 0.62)
    finding = Finding(BAD, BAD, NAMES, (plain,), 0.3, 120.0, 1e-9, (BAD, "payload"), f"{BAD} is there.", BAD, headline=True)
    body = Finding(BAD, BAD, (), (mass, vector), 0.2, 120.0, 1e-9, (), f"{BAD} is there.", BAD, headline=True)
    fault = Finding("torque_unit", "unit", (NAMES[0],), (), cast(Any, None), cast(Any, None), 1.0, (), "A unit.")
    ones = np.ones(3)
    temperature = {"joints": [BAD], "range": [(20.0, 30.0)], "friction_before": [-0.5], "friction_after": [None]}
    return Diagnosis(
        "partly_explained", NAMES, findings=(finding, body, fault),
        torque=TorqueRmse(NAMES, 4.0 * ones, 2.0 * ones, ones, 9.0 * ones),
        simulation=SimulationError(9.5, "mujoco", 0.3, 0.01, 0.01, 1.0, 0.1, 0.1, ones, ones, ones),
        unexplained_fraction=0.2, unexplained=BAD, record_next=(BAD,),
        predictions=predictions(), tracking=tracking_error(), temperature=temperature,
    )  # fmt: skip


def items() -> Figure:
    """One of everything that a figure can hold."""
    t, nan = np.arange(6.0), np.array([0.0, 1.0, np.nan, 3.0, 4.0, 5.0])
    panel = Panel(
        (
            Curve(t, nan, "line", dash="dashed"), Curve(t, t, "steps", step=True),
            Curve(t, -t, "points", width=0.0, marker="dot"), Band(t, nan - 1.0, nan + 1.0, "band"),
            Spans("x", t[:2], t[1:3], "spans"), Spans("y", t[:1], t[1:2], "held"),
            Mark("x", 2.0, "event", "mark"), Mark("y", 1.0, dash="dotted"),
        ),
        "panel [N m]", "note", Axis("time [s]", (0.0, 5.0)), Axis(ticks=((0.0, "zero"), (1.0, "one"))),
    )  # fmt: skip
    cells = Cells(np.eye(2), (("1", "0"), ("0", "1")), ("first", "second"), ("a", "b"), 1.0)
    log = Panel((Curve(t + 1.0, t + 1.0, "log"), Mark("x", 2.0, "at two")), x=Axis(limits=(1.0, 6.0), log=True), y=Axis(log=True))
    second = Stack((Panel((cells,), "cells"), log, Panel((), within="nothing here")), "heading", "words " * 30, shared=False)
    return Figure((Stack((panel,)), second), "title", "subtitle", columns=2)


def payload(path: Path) -> None:
    estimates, events, truth = pick_and_drop()
    carried = ellipsoid(arm(), "link 2", 1.0, np.zeros(3), BAD, 0.01 * np.eye(3), np.full(3, 0.01), (2.0, 8.0))
    seen = view(arm(), None, [Track("", T, postures())], BAD, ellipsoids=(carried,))
    write_payload_plot(path, estimates, events, NAMES, BAD, truth, UNITS, view=seen)


def tracking(path: Path) -> None:
    write_tracking(path, runs(), Followed(arm(), "link 2", 3.0, np.zeros(3), 0.01 * np.eye(3), EVENTS), BAD)


FIGURES: dict[str, Callable[[], Figure]] = {
    "items": items,
    "payload": lambda: payload_figure(*pick_and_drop()[:2], NAMES, UNITS, BAD, pick_and_drop()[2]),
    "tracking": lambda: tracking_figure(runs(), EVENTS, 3.0),
    "excitation": lambda: excitation_figure(excitation(), BAD),
    "frequency": lambda: frequency_figure(frequency(), BAD),
    "identification, torque": lambda: identification_figures.torque_figure(series()[0], NAMES, UNITS),
    "identification, residual": lambda: identification_figures.residual_figure(series(), NAMES, UNITS, (False, False, True), 4.0),
    "diagnosis, torque": lambda: diagnosis_figures.torque_figure(predictions(), UNITS),
    "diagnosis, tracking": lambda: diagnosis_figures.tracking_error_figure(tracking_error()),
    "diagnosis, residual": lambda: diagnosis_figures.residual_figure(predictions(), UNITS, np.ones(3)),
}
PAGES: dict[str, Callable[[Path], object]] = {
    "payload": payload,
    "tracking": tracking,
    "excitation": lambda path: write_excitation(path, excitation(), BAD),
    "frequency": lambda path: write_frequency_plot(path, frequency(), BAD, arm()),
    "diagnosis": lambda path: path.write_text(diagnosis_page(diagnosis(), BAD, {"bags": [f"/home/{BAD}"]}, arm())),
    "figure alone": lambda path: write_plot(path, excitation_figure(excitation(), BAD)),
    "refused": lambda path: path.write_text(diagnosis_page(Diagnosis("refused", NAMES, BAD), BAD, {"bags": ["/a/b"]})),
}


def panels_of(figure: Figure) -> list[Panel]:
    return [panel for stack in figure.stacks for panel in stack.panels]


def words_of(figure: Figure) -> set[str]:
    """All that stands in a figure beside legends and numbers; headings are broken into lines."""
    panels = panels_of(figure)
    words = {text for p in panels for text in (p.title, p.note, p.within)} | {s.title for s in figure.stacks}
    words |= {item.text for p in panels for item in p.items if isinstance(item, Mark)}
    words |= {s.panels[-1].x.label for s in figure.stacks}
    return words - {""}


def same(a: Any, b: Any) -> bool:
    a, b = (np.array([np.nan if x is None else x for x in values], dtype=float) for values in (a, b))
    return a.shape == b.shape and np.allclose(a, b, rtol=1e-5, atol=1e-12, equal_nan=True)


@pytest.mark.parametrize("name", FIGURES)
def test_matplotlib_shows_every_curve_and_label(name: str) -> None:
    figure = FIGURES[name]()
    picture = drawn(figure)
    panels = panels_of(figure)
    assert len(picture.axes) == len(panels)
    for panel, axes in zip(panels, picture.axes, strict=True):
        for curve in (item for item in panel.items if isinstance(item, Curve)):
            assert any(same(line.get_xdata(), curve.x) and same(line.get_ydata(), curve.y) for line in axes.lines)
        assert sum(isinstance(item, Band | Spans) for item in panel.items) == len(axes.collections)
        assert sum(isinstance(item, Curve | Mark) for item in panel.items) == len(axes.lines)
        assert sum(isinstance(item, Cells) for item in panel.items) == len(axes.images)
    picture.draw_without_rendering()
    said = {text.get_text().strip() for text in picture.findobj(Text)}
    wanted = words_of(figure) | {key.label for key in keys(panels)} | {figure.title}
    assert {text.replace("$", r"\$").strip() for text in wanted - {""}} <= said


@pytest.mark.parametrize("name", FIGURES)
def test_plotly_shows_every_curve_and_label(name: str) -> None:
    figure = FIGURES[name]()
    found = specification(figure)
    json.dumps(found, allow_nan=False)
    panels = panels_of(figure)
    for k, panel in enumerate(panels, start=1):
        own = [t for t in found["data"] if t.get("xaxis") == ("x" if k == 1 else f"x{k}")]
        for curve in (item for item in panel.items if isinstance(item, Curve)):
            traces = [t for t in own if t["type"] == "scatter" and t.get("meta") == curve.label]
            assert any(same(found["arrays"][t["x"]], curve.x) and same(found["arrays"][t["y"]], curve.y) for t in traces)
        drawn_ = [item for item in panel.items if isinstance(item, Curve | Band | Cells)]
        assert len(own) == max(1, len(drawn_))
    assert len(found["layout"]["shapes"]) == sum(isinstance(item, Spans | Mark) for p in panels for item in p.items)
    for width, layout in zip(WIDTHS, found["layouts"], strict=True):
        assert layout["least"] == width
        told = [a["text"] for a in layout["layout"]["annotations"]]
        told += [axis["title"]["text"] for axis in layout["layout"].values() if isinstance(axis, dict) and "title" in axis]
        plain = {text.removeprefix("<b>").removesuffix("</b>") if text.count("<b>") else text for text in told}
        assert {escape(text, quote=False) for text in words_of(figure)} <= plain
        assert not any("<" in text for text in plain)


@pytest.mark.parametrize("name", FIGURES)
def test_a_page_has_the_legend(name: str) -> None:
    figure = FIGURES[name]()
    text = page("figure.html", figure=figure)
    for _, entries in legends(figure):
        for key in entries:
            assert f'data-label="{escape(key.label).replace("&quot;", "&#34;")}"' in text
    found = elements(text)
    assert (found.wrong, found.open) == ([], [])


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_well_formed_and_needs_nothing_else_and_names_are_text(name: str, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    PAGES[name](path)
    text = path.read_text()
    found = elements(text)
    assert (found.wrong, found.open) == ([], [])
    assert alone(text)
    assert BAD not in text
    assert "<b>x</b>" not in text
    assert "alert(1)" in " ".join(found.text)
    assert all("/home" not in title and "/a/b" not in title for title in found.text[: found.text.index(found.text[-1])][:12])
    figures = [script for script in found.scripts if script.startswith("{") and "layouts" in script]
    robots = [script for script in found.scripts if script.startswith("{") and "layouts" not in script]
    assert len(robots) == (name not in ("refused", "figure alone"))
    assert all(json.loads(script)["tracks"] for script in robots)
    assert path.stat().st_size < 6e6
    assert len(figures) == found.tags.count("figure") == {"refused": 0, "diagnosis": 3}.get(name, 1)
    for script in figures:
        assert json.loads(script)["layouts"]
    for needed in ("viewport", "prefers-color-scheme: dark", "@media print"):
        assert needed in text


def test_headings_have_no_path_of_the_machine() -> None:
    text = diagnosis_page(
        diagnosis(), "arm", {"bags": ["/home/me/run1"], "validate": ["/home/me/run2"], "urdf": "/home/me/arm.urdf"}
    )
    head = text[text.index("<header>") : text.index("</header>")]
    assert "from run1; judged on run2, never fitted" in head
    assert "/home" not in head
    assert "/home/me/arm.urdf" in text


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize("width", [*WIDTHS, 1400.0])
def test_panels_stand_beside_each_other(name: str, width: float) -> None:
    figure = FIGURES[name]()
    found, height = places(figure, width)
    assert [p.panel for p in found] == panels_of(figure)
    boxes = [(p.left, p.top, p.left + p.width, p.top + p.height) for p in found]
    for a, b, c, d in boxes:
        assert 0.0 <= a < c <= width
        assert 0.0 <= b < d <= height
        assert c - a >= 0.2 * min(width, 320.0)
    for i, one in enumerate(boxes):
        for other in boxes[i + 1 :]:
            assert one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]


def test_peaks_are_kept() -> None:
    values = np.zeros(10_000)
    values[4321], values[8765] = 1.0, -1.0
    kept = peaks(values, 100)
    assert len(kept) <= 100
    assert {4321, 8765} <= set(kept.tolist())
