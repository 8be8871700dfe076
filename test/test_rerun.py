"""Recordings for the viewer of Rerun: the same figure and the same robot as on a page."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from robots import robot

from sysid_ros.cli.main import run
from sysid_ros.exceptions import SettingsError
from sysid_ros.pages import check_plot_paths, palette, rerun_renderer, write_plot
from sysid_ros.pages.figure import Axis, Band, Curve, Figure, Mark, Panel, Stack
from sysid_ros.pages.rerun_renderer import write_recording
from sysid_ros.pages.robot_view import Colouring, Ring, Track, View, ellipsoid, percentages, ring_radius, view

BAGS = Path(__file__).parents[1] / "bags"
T = np.linspace(0.0, 2.0, 21)
MODEL = robot("small_arm")


def response() -> Panel:
    """Over frequency, which the clock of the page does not move."""
    return Panel((Curve(T + 0.1, T, "gain"),), "Response", x=Axis("frequency [Hz]", log=True))


def seen() -> tuple[Figure, View]:
    curve, band = Curve(T, np.sin(T), "mass"), Band(T, np.sin(T) - 0.1, np.sin(T) + 0.1, "95 %")
    panel = Panel((curve, band, Mark("x", 1.0, "pick")), "Mass [kg]", x=Axis("time [s]", clock=True))
    other = response()
    q = np.outer(np.sin(T), np.linspace(0.3, 0.9, MODEL.n))
    body = ellipsoid(MODEL, MODEL.default_frame, 1.5, np.array([0.0, 0.0, 0.05]), "1.5 kg", span=(1.0, 1.5))
    found = view(MODEL, None, [Track("", T, q)], ellipsoids=(body,))
    assert found is not None
    return Figure((Stack((panel,)), Stack((other,))), "Payload"), found


class Stand:
    """Takes what a recording of Rerun takes, and keeps it."""

    def __init__(self, name: str) -> None:
        self.static: dict[str, Any] = {}
        self.over_time: dict[str, Any] = {}
        self.words: list[Any] = []
        Stand.newest = self

    newest: Stand

    def save(self, path: str) -> None:
        Path(path).write_bytes(b"recording")

    def log(self, path: str, what: Any, static: bool = False) -> None:
        if static:
            self.static[path] = what
        self.words.append(what)

    def send_blueprint(self, what: Any) -> None:
        self.shown = what

    def send_columns(self, path: str, indexes: list[Any], columns: Any) -> None:
        self.over_time[path] = (indexes[0], columns)

    def __getattr__(self, name: str) -> Any:
        return lambda *args, **kwargs: None


def kept(kind: str) -> Any:
    def make(*args: Any, **kwargs: Any) -> SimpleNamespace:
        return SimpleNamespace(kind=kind, args=args, **kwargs)

    make.columns = make  # type: ignore[attr-defined]
    return make


@pytest.fixture
def stand(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("Transform3D", "Mesh3D", "Ellipsoids3D", "SeriesLines", "Scalars", "TextLog", "Clear", "TimeColumn")
    others = ("LineStrips3D", "TextDocument", "EncodedImage")
    library = SimpleNamespace(**{name: kept(name) for name in (*names, *others)}, RecordingStream=Stand, new_entity_path="/".join)
    shown = ("Blueprint", "Horizontal", "Vertical", "Tabs", "Spatial2DView", "Spatial3DView", "TimeSeriesView", "TextLogView")
    library.blueprint = SimpleNamespace(**{name: kept(name) for name in (*shown, "TextDocumentView")})
    library.ViewCoordinates = SimpleNamespace(RIGHT_HAND_Z_UP=None)
    monkeypatch.setattr(rerun_renderer, "rerun", lambda: library)


@pytest.mark.usefixtures("stand")
def test_the_robot_moves_as_its_model_does(tmp_path: Path) -> None:
    figure, found = seen()
    write_plot(tmp_path / "x.rrd", figure, view=found)
    stream, (track,) = Stand.newest, found.tracks
    data = MODEL.model.createData()
    for k in (0, 7, len(track.t) - 1):
        pin.forwardKinematics(MODEL.model, data, track.q[k])
        at, placed = "robot", pin.SE3.Identity()
        for j, name in enumerate(MODEL.joint_names):
            still, moves = stream.static[f"{at}/{name}"], stream.over_time[f"{at}/{name}/moved"][1]
            if MODEL.is_prismatic[j]:
                moved = pin.SE3(np.eye(3), np.asarray(moves.translation)[k])
            else:
                moved = pin.SE3(pin.Quaternion(np.asarray(moves.quaternion)[k]).matrix(), np.zeros(3))
            placed = placed * pin.SE3(still.mat3x3, still.translation) * moved
            np.testing.assert_allclose(placed.homogeneous, data.oMi[j + 1].homogeneous, atol=1e-9)
            at = f"{at}/{name}/moved"
    assert any(path.startswith(at) for path in stream.static)


@pytest.mark.usefixtures("stand")
def test_what_has_the_clock_is_there_and_nothing_else(tmp_path: Path) -> None:
    figure, found = seen()
    write_plot(tmp_path / "x.rrd", figure, view=found)
    stream = Stand.newest
    lines = [path for path in stream.over_time if path.startswith("figures")]
    assert lines == ["figures/Mass [kg]/mass", "figures/Mass [kg]/95 %, low", "figures/Mass [kg]/95 %, high"]
    np.testing.assert_array_equal(stream.over_time[lines[0]][1].scalars, np.sin(T))
    kinds = [word.kind for word in stream.words if word is not None]
    assert kinds.count("TextLog") == 1
    assert kinds.count("Ellipsoids3D") == kinds.count("Clear") == 1


@pytest.mark.usefixtures("stand")
def test_each_way_to_colour_the_robot_is_a_tab(tmp_path: Path) -> None:
    """Before and after: every shape once in each colour, seen in a tab that leaves the other ones out; a ring about a joint."""
    figure, found = seen()
    most, n = 4.0, MODEL.n
    before, after = (
        Colouring(name, values, tuple(f"{x:g} x" for x in values), most, ("0", "4"))
        for name, values in (("as given", (4.0,) * n), ("with the causes", (0.0,) * n))
    )
    found = replace(found, colourings=(before, after), rings=(Ring((1,), "friction"),))
    write_recording(tmp_path / "x.rrd", [figure], found)
    stream = Stand.newest
    meshes = {path: what.albedo_factor for path, what in stream.static.items() if what is not None and what.kind == "Mesh3D"}
    moved = [shape for shape in found.looks.shapes if shape.joint >= 0]
    for colouring, colour in ((before, palette.SCALE[-1]), (after, palette.SCALE[0])):
        own = {path: c for path, c in meshes.items() if path.endswith(colouring.name)}
        assert len(own) == len(found.looks.shapes)
        assert list(own.values()).count(tuple(bytes.fromhex(colour[1:]))) == len(moved)
        (tab,) = (tab for tab in stream.shown.args[0].args[0].args[0].args if tab.name == colouring.name)
        assert tab.contents == ["+ /robot/**", *(f"- {path}" for path in meshes if path not in own)]
    (ring,) = (what for what in stream.static.values() if what is not None and what.kind == "LineStrips3D")
    (circle,) = ring.args[0]
    np.testing.assert_allclose(circle @ found.looks.axis[1], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(circle, axis=1), ring_radius(found.looks, 1))
    (told,) = (what.args[0] for what in stream.static.values() if what is not None and what.kind == "TextDocument")
    assert f"| {MODEL.joint_names[0]} | 4 x | 0 x |" in told


@pytest.mark.usefixtures("stand")
def test_a_figure_over_frequency_is_a_picture(tmp_path: Path) -> None:
    write_plot(tmp_path / "x.rrd", Figure((Stack((response(),)),), "Bode"), view=None)
    (picture,) = Stand.newest.static.items()
    assert picture[0] == "pictures/Bode"
    assert picture[1].contents.startswith(b"\x89PNG")
    assert not Stand.newest.over_time


def test_the_suffix_is_that_of_rerun() -> None:
    with pytest.raises(SettingsError, match=r"ends in \.rrd"):
        check_plot_paths(None, Path("x.png"))


@pytest.mark.parametrize("command", ["identify", pytest.param("diagnose", marks=pytest.mark.slow), "frequency"])
@pytest.mark.usefixtures("stand")
def test_what_the_page_of_a_command_shows(command: str, tmp_path: Path) -> None:
    """The same robot in the same colours, and the same curves over time, as on its page."""
    out, bag = tmp_path / f"{command}.rrd", str(BAGS / "arm_empty")
    results = [] if command == "frequency" else ["--out", str(tmp_path / "out")]
    assert run([command, bag, *results, "--rerun", str(out)]) == 0
    assert out.read_bytes() == b"recording"
    stream = Stand.newest
    lines = {path.split("/")[-1] for path in stream.over_time if path.startswith("figures")}
    pictures = sum(path.startswith("pictures") for path in stream.static)
    shapes = [path for path, what in stream.static.items() if what is not None and what.kind == "Mesh3D"]
    tracking = {"nominal model", "noise alone", "extended model"}
    told = {
        "identify": ({"URDF alone", "measured", "predicted"}, 1, {"URDF alone", "with friction", "identified"}),
        "diagnose": ({"model as given", "measured", "with the causes", *tracking}, 1, {"as given", "with the causes"}),
        "frequency": (set(), 1, {"misfit"}),
    }
    assert (lines, pictures, {path.split(", ")[-1] for path in shapes}) == told[command]
    assert any(path.startswith("robot") and path.endswith("moved") for path in stream.over_time)


def test_rerun_reads_it(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="Rerun is not installed: pip install 'sysid_ros[rerun]'")
    figure, found = seen()
    found = replace(found, colourings=(percentages("misfit", [0.1] * MODEL.n),) * 2, rings=(Ring((0,), "spring"),))
    write_recording(tmp_path / "x.rrd", [figure, Figure((Stack((response(),)),), "Bode: a/b (c)")], found)
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(tmp_path / "x.rrd")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "verified without error" in done.stdout + done.stderr
