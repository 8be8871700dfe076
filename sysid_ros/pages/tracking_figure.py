"""Control laws side by side: the tip's error and the mass that each believes in, over time, and the arm that they moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sysid_ros.control.tracking_run import TrackingRun
from sysid_ros.pages import palette
from sysid_ros.pages.figure import Axis, Curve, Figure, Mark, Panel, Stack
from sysid_ros.pages.page import VIEW_SUFFIXES, check_plot_path, write_plot
from sysid_ros.pages.robot_view import Track, View, ellipsoid, view
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_COLOURS = (palette.SOFT, *palette.MANY[:4])
_LEAST = 1e-3
"""Errors below this are drawn there, on a logarithmic axis [mm]."""


@dataclass(frozen=True, eq=False, slots=True)
class Followed:
    """What the laws had to do.

    Attributes:
        robot: that followed a motion. frame: link that carries the body. mass: of it [kg]. com: its centre of mass in the frame,
            shape (3,) [m]. inertia_com: about it, shape (3, 3) [kg m^2]. events: t [s] and kind, "pick" or "drop".
    """

    robot: RobotModel
    frame: str
    mass: float
    com: FloatArray
    inertia_com: FloatArray
    events: tuple[tuple[float, str], ...]


def write_tracking(path: Path, runs: Sequence[TrackingRun], followed: Followed, answer: str) -> None:
    """Write errors and masses over time; a page also shows the arm, moved by each of the laws, and begins with the answer.

    Raises:
        SettingsError: the suffix is not known, or the folder is not there.
    """
    check_plot_path(path)
    seen = _view(runs, followed) if path.suffix.lower() in VIEW_SUFFIXES else None
    figure = tracking_figure(runs, followed.events, followed.mass)
    write_plot(path, figure, answer=answer, heading="Errors and masses over time", view=seen)


def _view(runs: Sequence[TrackingRun], of: Followed) -> View | None:
    """The arm as each law moved it, and what it carries."""
    tracks = [Track(_name(run), run.t, run.q) for run in runs if run.q is not None]
    end = max((float(track.t[-1]) for track in tracks), default=0.0)
    pick = next((t for t, kind in of.events if kind == "pick"), 0.0)
    drop = next((t for t, kind in of.events if kind == "drop"), end + 1.0)
    body = ellipsoid(of.robot, of.frame, of.mass, of.com, f"{of.mass:g} kg", of.inertia_com, span=(pick, drop))
    caption = (
        "The arm as each law moves it; the body that it picks up is drawn as the homogeneous ellipsoid of its mass and inertia."
    )
    return view(of.robot, None, tracks, caption, ellipsoids=(body,))


def _name(run: TrackingRun) -> str:
    return run.law.replace("_", " ").replace("slotine li", "Slotine-Li")


def tracking_figure(runs: Sequence[TrackingRun], events: Sequence[tuple[float, str]], mass: float) -> Figure:
    """Errors above, masses below.

    Args:
        runs: of the same scenario. events: t [s] and kind. mass: that is carried between pick and drop [kg].
    """
    end = max(float(run.t[-1]) for run in runs)
    time = Axis("time [s]", (0.0, end), clock=True)
    errors, masses = [], []
    for run, colour in zip(runs, _COLOURS, strict=False):
        name = _name(run)
        errors.append(Curve(run.t, np.maximum(1e3 * run.tip_error, _LEAST), name, colour, 1.2))
        masses.append(Curve(run.t, run.mass, name, colour))
    masses.append(Curve(*_carried(events, mass, end), "truth", width=1.1, dash="dotted"))
    marks = tuple(Mark("x", t, kind) for t, kind in events)
    lines = tuple(Mark("x", t) for t, _ in events)
    above = Panel((*marks, *errors), "Distance of the tip from its path [mm]", x=time, y=Axis(log=True), height=300.0)
    below = Panel((*lines, *masses), "Mass that the law believes in [kg]", x=time, height=200.0)
    return Figure((Stack((above, below)),), "Control laws with a payload unknown to them", f"{mass:g} kg are picked up")


def _carried(events: Sequence[tuple[float, str]], mass: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the true mass over time."""
    times, masses = [0.0], [0.0]
    for t, kind in sorted(events):
        times += [t, t]
        masses += [masses[-1], mass if kind == "pick" else 0.0]
    return np.array([*times, end]), np.array([*masses, masses[-1]])
