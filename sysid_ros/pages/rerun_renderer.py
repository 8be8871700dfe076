"""Draws a figure and the robot of a page as a recording of Rerun (https://rerun.io)."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.files import whole
from sysid_ros.pages.figure import Band, Curve, Figure, Mark, Panel
from sysid_ros.pages.robot_view import Colouring, Ellipsoid, Track, View
from sysid_ros.robot.rotation import quaternion
from sysid_ros.sample import FloatArray

_CLOCK = "time"
_LIMIT = 0.6
"""Width of the limits of a band beside its curve [px]."""


def rerun() -> ModuleType:
    """The library.

    Raises:
        SettingsError: it is not installed.
    """
    try:
        return importlib.import_module("rerun")
    except ImportError:
        raise SettingsError("A recording of Rerun needs its library: pip install 'sysid_ros[rerun]'.") from None


def write_recording(path: Path, figure: Figure, view: View | None = None) -> None:
    """Write the panels of a figure that have the clock of the page as x axis, and the robot, over the same time.

    Args:
        path: the .rrd file. figure: as a page or a picture draws it. view: of the robot; None for none.

    Raises:
        SettingsError: the library is not installed. OutputError: it can't be written.
    """
    library = rerun()
    with whole(path) as beside:
        stream = library.RecordingStream(f"sysid_ros {figure.title}".strip())
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        stream.save(str(beside))
        for stack in figure.stacks:
            for panel in stack.panels:
                if panel.x.clock or (stack.shared and stack.panels[-1].x.clock):
                    _panel(library, stream, [x for x in ("figures", stack.title, panel.title) if x], panel)
        if view is not None:
            _robot(library, stream, view)
        stream.flush()
        stream.disconnect()


def _panel(library: ModuleType, stream: Any, at: list[str], panel: Panel) -> None:
    curves = [item for item in panel.items if isinstance(item, Curve) and item.width]
    for k, item in enumerate(panel.items):
        if isinstance(item, Curve) and item.width:
            name = item.label or (panel.title if len(curves) == 1 else f"curve {k}")
            _line(library, stream, [*at, name], item.x, item.y, item.colour, item.width)
        elif isinstance(item, Band) and curves:  # beside none it is a strip of colours
            for end, values in (("low", item.low), ("high", item.high)):
                _line(library, stream, [*at, f"{item.label or f'band {k}'}, {end}"], item.x, values, item.colour, _LIMIT)
        elif isinstance(item, Mark) and item.axis == "x" and item.text:
            stream.set_time(_CLOCK, duration=float(item.at))
            stream.log("events", library.TextLog(item.text))


def _line(library: ModuleType, stream: Any, at: list[str], x: FloatArray, y: FloatArray, colour: str, width: float) -> None:
    seen = np.isfinite(x) & np.isfinite(y)
    if not seen.any():
        return
    path = library.new_entity_path(at)
    stream.log(path, library.SeriesLines(colors=_rgb(colour), names=at[-1], widths=width), static=True)
    times = library.TimeColumn(_CLOCK, duration=np.asarray(x, dtype=float)[seen])
    stream.send_columns(path, [times], library.Scalars.columns(scalars=np.asarray(y, dtype=float)[seen]))


def _robot(library: ModuleType, stream: Any, view: View) -> None:
    stream.log("/", library.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    colouring = view.colourings[0] if view.colourings else None
    for track in view.tracks:
        root = ["robot", track.name] if track.name else ["robot"]
        paths = _joints(library, stream, view, root, track)
        for k, shape in enumerate(view.looks.shapes):
            colour = _rgb(_colour(view, colouring, shape.joint) or shape.colour)
            stream.log(
                library.new_entity_path([*paths[shape.joint], f"shape {k}"]),
                library.Mesh3D(vertex_positions=shape.vertices, triangle_indices=shape.triangles, albedo_factor=colour),
                static=True,
            )
        for k, body in enumerate(view.ellipsoids):
            _ellipsoid(library, stream, library.new_entity_path([*paths[body.joint], f"body {k}"]), body)


def _joints(library: ModuleType, stream: Any, view: View, root: list[str], track: Track) -> dict[int, list[str]]:
    """The path of each joint's frame, below that of the joint before it; -1: the base."""
    looks, t = view.looks, library.TimeColumn(_CLOCK, duration=np.asarray(track.t, dtype=float))
    paths = {-1: root}
    if track.orientation is not None:
        stream.send_columns(library.new_entity_path(root), [t], library.Transform3D.columns(quaternion=track.orientation))
    for j, name in enumerate(looks.joint_names):
        at = [*paths[looks.parent[j]], name]
        placed = library.Transform3D(translation=looks.origin[j], mat3x3=looks.rotation[j])
        stream.log(library.new_entity_path(at), placed, static=True)
        paths[j] = [*at, "moved"]
        if looks.slides[j]:
            moves = library.Transform3D.columns(translation=track.q[:, j, None] * looks.axis[j])
        else:
            half = 0.5 * track.q[:, j, None]
            moves = library.Transform3D.columns(quaternion=np.hstack([np.sin(half) * looks.axis[j], np.cos(half)]))
        stream.send_columns(library.new_entity_path(paths[j]), [t], moves)
    return paths


def _ellipsoid(library: ModuleType, stream: Any, path: str, body: Ellipsoid) -> None:
    """From when it is there until it is gone."""
    shown = [(body.axes, "solid"), *([(body.outline, "majorwireframe")] if body.outline is not None else [])]
    for axes, fill in shown:
        drawn = library.Ellipsoids3D(
            centers=[body.position], half_sizes=[axes], quaternions=[quaternion(body.rotation)], fill_mode=fill,
            colors=[_rgb("#E8772E")], labels=[body.label] if fill == "solid" else None,
        )  # fmt: skip
        where = f"{path}/{fill}"
        if body.start is None:
            stream.log(where, drawn, static=True)
            continue
        stream.set_time(_CLOCK, duration=body.start)
        stream.log(where, drawn)
        if body.end is not None:
            stream.set_time(_CLOCK, duration=body.end)
            stream.log(where, library.Clear(recursive=False))


def _colour(view: View, colouring: Colouring | None, joint: int) -> str:
    if colouring is None or joint < 0:
        return ""
    return view.colour(colouring.values[joint], colouring.most)


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
