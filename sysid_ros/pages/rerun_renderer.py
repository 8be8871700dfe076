"""Draws the figures and the robot of a page as a recording of Rerun (https://rerun.io)."""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.files import whole
from sysid_ros.pages import palette
from sysid_ros.pages.figure import Band, Curve, Figure, Mark, Panel
from sysid_ros.pages.robot_view import Colouring, Ellipsoid, Track, View, ring_radius
from sysid_ros.robot.rotation import quaternion
from sysid_ros.sample import FloatArray

_CLOCK = "time"
_LIMIT = 0.6
"""Width of the limits of a band beside its curve [px]."""
_LONGEST = 60
"""Characters of a recording's name."""
_ON_DARK = "#9A9A9A"
"""Instead of ink: the viewer is dark or light as its reader likes."""
_RING = 0.009
"""Half of the thickness of a ring about a joint, as a part of the robot's size."""


def rerun() -> ModuleType:
    """The library.

    Raises:
        SettingsError: it is not installed.
    """
    try:
        return importlib.import_module("rerun")
    except ImportError:
        raise SettingsError("A recording of Rerun needs its library: pip install 'sysid_ros[rerun]'.") from None


def write_recording(path: Path, figures: Sequence[Figure], view: View | None = None) -> None:
    """Write the panels of figures that have the clock of the page as x axis, and the robot, over the same time; a figure that has
    none of them as a picture. The robot is there once for each way to colour it, in tabs.

    Args:
        path: the .rrd file. figures: as a page or a picture draws them. view: of the robot; None for none.

    Raises:
        SettingsError: the library is not installed. OutputError: it can't be written.
    """
    library = rerun()
    title = next((figure.title for figure in figures if figure.title), path.stem)
    with whole(path) as beside:
        # the viewer keeps what its windows show under this name, which takes few characters
        stream = library.RecordingStream("_".join(["sysid_ros", *re.findall(r"\w+", title, re.ASCII)])[:_LONGEST])
        stream.send_recording_name(title)
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        stream.save(str(beside))
        tabs = [_figure(library, stream, figure, f"figure {k}") for k, figure in enumerate(figures, 1)]
        parts = [] if view is None else [_robot(library, stream, view)]
        parts += [library.blueprint.Tabs(*tabs)] if tabs else []
        stream.send_blueprint(library.blueprint.Blueprint(library.blueprint.Horizontal(*parts), collapse_panels=True))
        stream.flush()
        stream.disconnect()


def _figure(library: ModuleType, stream: Any, figure: Figure, other: str) -> Any:
    """A figure, under its title or else another; how the viewer shows it."""
    on_the_clock = [
        (["figures", *(x for x in (stack.title, panel.title) if x)], panel)
        for stack in figure.stacks
        for panel in stack.panels
        if panel.x.clock or (stack.shared and stack.panels[-1].x.clock)
    ]
    if not on_the_clock:
        return _picture(library, stream, figure, figure.title or other)
    for at, panel in on_the_clock:
        _panel(library, stream, at, panel)
    series = library.blueprint.TimeSeriesView
    views = [series(origin=library.new_entity_path(at), name=at[-1]) for at, panel in on_the_clock]
    if any(isinstance(item, Mark) and item.axis == "x" and item.text for _, panel in on_the_clock for item in panel.items):
        views.append(library.blueprint.TextLogView(origin="events"))
    return library.blueprint.Vertical(*views, name=figure.title or other)


def _picture(library: ModuleType, stream: Any, figure: Figure, name: str) -> Any:
    """A figure over frequencies, positions, ..., which a time line can't hold."""
    from sysid_ros.pages.matplotlib_renderer import drawn  # takes a part of a second to import

    file = BytesIO()
    drawn(figure).savefig(file, dpi=150, format="png")
    path = library.new_entity_path(["pictures", name])
    stream.log(path, library.EncodedImage(contents=file.getvalue(), media_type="image/png"), static=True)
    return library.blueprint.Spatial2DView(origin=path, name=name)


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
    seen_on = _ON_DARK if colour == palette.INK else colour
    stream.log(path, library.SeriesLines(colors=_rgb(seen_on), names=at[-1], widths=width), static=True)
    times = library.TimeColumn(_CLOCK, duration=np.asarray(x, dtype=float)[seen])
    stream.send_columns(path, [times], library.Scalars.columns(scalars=np.asarray(y, dtype=float)[seen]))


def _robot(library: ModuleType, stream: Any, view: View) -> Any:
    """The robot of each motion, in all of its colours; how the viewer shows it."""
    stream.log("/", library.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    ways: Sequence[Colouring | None] = view.colourings or (None,)
    paths_of: dict[int, list[str]] = {way: [] for way in range(len(ways))}
    for track in view.tracks:
        root = ["robot", track.name] if track.name else ["robot"]
        paths = _joints(library, stream, view, root, track)
        for way, colouring in enumerate(ways):
            for k, shape in enumerate(view.looks.shapes):
                name = f"shape {k}" if colouring is None else f"shape {k}, {colouring.name}"
                path = library.new_entity_path([*paths[shape.joint], name])
                colour = _rgb(_colour(view, colouring, shape.joint) or shape.colour)
                mesh = library.Mesh3D(vertex_positions=shape.vertices, triangle_indices=shape.triangles, albedo_factor=colour)
                stream.log(path, mesh, static=True)
                paths_of[way].append(path)
        for k, body in enumerate(view.ellipsoids):
            _ellipsoid(library, stream, library.new_entity_path([*paths[body.joint], f"body {k}"]), body)
        for ring in view.rings:
            for joint in ring.joints:
                _ring(library, stream, library.new_entity_path([*paths[joint], ring.label]), view, joint, ring.label)
    about = library.new_entity_path(["about the robot"])
    stream.log(about, library.TextDocument(_told(view), media_type="text/markdown"), static=True)
    tabs = []
    for way, colouring in enumerate(ways):
        others = [f"- {path}" for other, paths in paths_of.items() if other != way for path in paths]
        name = "robot" if colouring is None else colouring.name
        tabs.append(library.blueprint.Spatial3DView(origin="/", contents=["+ /robot/**", *others], name=name))
    below = library.blueprint.TextDocumentView(origin=about, name="about the robot")
    return library.blueprint.Vertical(library.blueprint.Tabs(*tabs), below, row_shares=[3.0, 1.0])


def _told(view: View) -> str:
    """What is seen, and the value of each joint behind its colour, in Markdown."""
    lines = [view.about]
    if view.colourings:
        heads = ["joint", *(colouring.name for colouring in view.colourings)]
        rows = zip(view.looks.joint_names, *(colouring.texts for colouring in view.colourings), strict=True)
        lines += ["", *(f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *rows))]
    return "\n".join(lines)


def _ring(library: ModuleType, stream: Any, path: str, view: View, joint: int, label: str) -> None:
    """About a joint's axis."""
    axis, radius = view.looks.axis[joint], ring_radius(view.looks, joint)
    across = np.linalg.svd(axis[None, :])[2][1:]
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    circle = radius * np.column_stack([np.cos(angle), np.sin(angle)]) @ across
    strip = library.LineStrips3D([circle], radii=_RING * view.looks.size, colors=[_rgb(palette.BLUE)], labels=[label])
    stream.log(path, strip, static=True)


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
