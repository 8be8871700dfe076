"""Recordings for the viewer of Rerun: the same figure and the same robot as on a page."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from robots import robot

from sysid_ros.exceptions import SettingsError
from sysid_ros.pages import check_plot_paths, rerun_renderer, write_plot
from sysid_ros.pages.figure import Axis, Band, Curve, Figure, Mark, Panel, Stack
from sysid_ros.pages.robot_view import Track, View, ellipsoid, view

T = np.linspace(0.0, 2.0, 21)
MODEL = robot("small_arm")


def seen() -> tuple[Figure, View]:
    curve, band = Curve(T, np.sin(T), "mass"), Band(T, np.sin(T) - 0.1, np.sin(T) + 0.1, "95 %")
    panel = Panel((curve, band, Mark("x", 1.0, "pick")), "Mass [kg]", x=Axis("time [s]", clock=True))
    other = Panel((Curve(T, T, "gain"),), "Response", x=Axis("frequency [Hz]", log=True))
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
    library = SimpleNamespace(**{name: kept(name) for name in names}, RecordingStream=Stand, new_entity_path="/".join)
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


def test_the_suffix_is_that_of_rerun() -> None:
    with pytest.raises(SettingsError, match=r"ends in \.rrd"):
        check_plot_paths(None, Path("x.png"))


def test_rerun_reads_it(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="Rerun is not installed: pip install 'sysid_ros[rerun]'")
    figure, found = seen()
    write_plot(tmp_path / "x.rrd", figure, view=found)
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(tmp_path / "x.rrd")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert "verified without error" in done.stdout + done.stderr
