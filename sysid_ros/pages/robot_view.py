"""The robot of a page: what it looks like, how it moves, what is coloured on it and what it carries, as plain values."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.pages import palette
from sysid_ros.pages.figure import evenly
from sysid_ros.robot.appearance import Appearance, appearance, files_of, in_joint
from sysid_ros.robot.mjcf_geoms import mjcf_geoms
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

RATE = 25.0
"""Postures a second that a page holds [Hz]: as a film."""
_MOST_POSTURES = 6000
"""Four minutes of these; of a longer motion the page holds fewer a second."""
_LEVELS = 65535
_SOURCES = {
    "meshes": "Shapes are those of its description, simplified.",
    "shapes": "Shapes are those of its description.",
    "lines": "No meshes of it are on this machine: links are drawn as lines between their joints.",
}


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """A motion.

    Attributes:
        name: where there are several. t: on the clock of the page, which the axes of figures show, shape (N,) [s].
        q: joint positions, shape (N, n) [rad or m]. orientation: of the base in the world, x, y, z, w, shape (N, 4); None where
            it stands upright.
    """

    name: str
    t: FloatArray
    q: FloatArray
    orientation: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class Colouring:
    """A value of each joint as a colour.

    Attributes:
        name: what it is. values: shape (n,), NaN where it is not known. texts: the same for people. most: that the scale ends at.
        ends: texts of 0 and of the most.
    """

    name: str
    values: tuple[float, ...]
    texts: tuple[str, ...]
    most: float
    ends: tuple[str, str]


@dataclass(frozen=True, eq=False, slots=True)
class Ellipsoid:
    """Something that is carried or hidden.

    Attributes:
        joint: that moves it, an index, -1 for the base. position: of its centre in that joint's frame, shape (3,) [m].
        rotation: of its axes, shape (3, 3). axes: half of its lengths, shape (3,) [m]. outline: those of a second one about it;
            None for none. label: beside it. start, end: when it is there, on the clock of the page [s]; None for always.
    """

    joint: int
    position: FloatArray
    rotation: FloatArray
    axes: FloatArray
    outline: FloatArray | None
    label: str
    start: float | None = None
    end: float | None = None


@dataclass(frozen=True, slots=True)
class Ring:
    """Joints, by index, at which something was found; the label stands at the first of them."""

    joints: tuple[int, ...]
    label: str


@dataclass(frozen=True, eq=False, slots=True)
class View:
    """All of it.

    Attributes:
        caption: what is seen, in a sentence or two. colourings: between which the reader can switch, the first one shown.
    """

    looks: Appearance
    tracks: tuple[Track, ...]
    caption: str = ""
    colourings: tuple[Colouring, ...] = ()
    ellipsoids: tuple[Ellipsoid, ...] = ()
    rings: tuple[Ring, ...] = ()
    colours: tuple[str, ...] = field(default=palette.SCALE)

    @property
    def about(self) -> str:
        """The caption, and where the shapes come from."""
        return f"{self.caption} {_SOURCES[self.looks.source]}".strip()

    def colour(self, value: float, most: float) -> str:
        """Of a value on the scale, as the page draws it."""
        if not np.isfinite(value):
            return palette.PALE
        at = min(max(value / max(most, 1e-12), 0.0), 1.0) * (len(self.colours) - 1)
        k = min(int(at), len(self.colours) - 2)
        ends = [np.array([int(c[i : i + 2], 16) for i in (1, 3, 5)]) for c in self.colours[k : k + 2]]
        mixed = ends[0] + (at - k) * (ends[1] - ends[0])
        return "#" + "".join(f"{round(float(x)):02X}" for x in mixed)


def view(robot: RobotModel | None, urdf: Path | None, tracks: Sequence[Track], caption: str = "", **what: Any) -> View | None:
    """The view of a robot; None where there is no robot or no motion.

    Args:
        urdf: its file, beside which meshes are looked for; None where it is no file. what: the other fields of :class:`View`.
    """
    moving = [track for track in tracks if len(track.t) > 1]
    if robot is None or not moving:
        return None
    return View(appearance(robot, files_of(urdf), mjcf_geoms(urdf)), tuple(map(thinned, moving)), caption, **what)


def thinned(track: Track) -> Track:
    """As many of its postures as a page holds, at their own times."""
    t = np.asarray(track.t, dtype=float)
    whole = np.isfinite(t) & np.isfinite(track.q).all(axis=1)
    whole[1:] &= t[1:] > np.fmax.accumulate(t)[:-1]
    at = np.flatnonzero(whole)
    if len(at) > 1:
        # the first of each twenty-fifth of a second, and the last of all
        beat = np.floor((t[at] - t[at[0]]) * RATE + 1e-6)
        at = np.union1d(at[np.flatnonzero(np.diff(beat, prepend=-1.0) > 0.0)], at[-1:])
        at = at[evenly(len(at), _MOST_POSTURES)]
    turned = None if track.orientation is None else np.asarray(track.orientation)[at]
    return Track(track.name, t[at], np.asarray(track.q, dtype=float)[at], turned)


def percentages(name: str, parts: Sequence[float] | FloatArray, most: float | None = None) -> Colouring:
    """Parts of a whole; ``most``: of the scale, of several colourings that are to be compared."""
    values = tuple(float(x) for x in parts)
    top = most if most is not None else max([x for x in values if np.isfinite(x)], default=1.0)
    return Colouring(name, values, tuple(map(_percent, values)), max(top, 1e-9), ("0", _percent(top)))


def _percent(part: float) -> str:
    if not np.isfinite(part):
        return "–"
    return f"{100.0 * part:.2g} %" if part < 0.995 else f"{100.0 * part:.0f} %"


def ellipsoid(
    robot: RobotModel,
    frame: str,
    mass: float,
    com: FloatArray,
    label: str,
    inertia_com: FloatArray | None = None,
    com_std: FloatArray | None = None,
    span: tuple[float | None, float | None] = (None, None),
) -> Ellipsoid:
    """The homogeneous ellipsoid of a body's mass and inertia at its centre of mass; of its outline every half axis is longer by
    the longest half of the 95 % interval of the centre. Where the inertia is not known, or no body's, a ball of water.

    Args:
        frame: link that the body is fixed to. com, com_std: in it, shape (3,) [m]. inertia_com: about it, shape (3, 3) [kg m^2].
        span: when it is there, on the clock of the page [s].
    """
    joint, rotation, translation = in_joint(robot, frame)
    axes, turned = np.full(3, (3.0 * abs(mass) / (4.0e3 * np.pi)) ** (1.0 / 3.0)), np.eye(3)
    if inertia_com is not None and mass > 0.0:
        moments, vectors = np.linalg.eigh(inertia_com)
        squares = 2.5 / mass * (moments.sum() - 2.0 * moments)
        if np.all(squares > 1e-8):
            axes, turned = np.sqrt(squares), vectors * np.sign(np.linalg.det(vectors))
    outline = None
    if com_std is not None and np.isfinite(com_std).all():
        outline = axes + 1.96 * float(np.max(com_std))
    centre = rotation @ np.asarray(com, dtype=float) + translation
    return Ellipsoid(joint, centre, rotation @ turned, axes, outline, label, *span)


def scene(seen: View) -> dict[str, Any]:
    """The view as the JSON that a page holds: numbers in base64, little-endian. ``joints`` are as in :class:`.Appearance`."""
    looks = seen.looks
    joints = [
        {
            "name": looks.joint_names[j],
            "parent": looks.parent[j],
            "rotation": _rounded(looks.rotation[j].ravel(), 9),
            "origin": _rounded(looks.origin[j], 7),
            "axis": _rounded(looks.axis[j], 9),
            "slides": looks.slides[j],
            "ring": round(ring_radius(looks, j), 4),
        }
        for j in range(len(looks.joint_names))
    ]
    return {
        "size": round(looks.size, 4),
        "joints": joints,
        "shapes": [
            {"joint": s.joint, "colour": s.colour, "triangles": _bytes(s.triangles, "<u2")} | _quantised(s.vertices)
            for s in looks.shapes
        ],
        "tracks": [_track(track) for track in seen.tracks],
        "colours": list(seen.colours),
        "colourings": [{"values": [_or_null(x) for x in c.values], "most": c.most} for c in seen.colourings],
        "ellipsoids": [
            {
                "joint": e.joint,
                "position": _rounded(e.position, 5),
                "rotation": _rounded(np.asarray(e.rotation).ravel(), 6),
                "axes": _rounded(e.axes, 5),
                "outline": None if e.outline is None else _rounded(e.outline, 5),
                "label": e.label,
                "start": e.start,
                "end": e.end,
            }
            for e in seen.ellipsoids
        ],
        "rings": [{"joints": list(r.joints), "label": r.label} for r in seen.rings],
    }


def ring_radius(looks: Appearance, joint: int) -> float:
    """Of a ring about a joint: a little more than what its links have there [m]."""
    axis, reach = looks.axis[joint], []
    for shape in looks.shapes:
        if shape.joint == joint:
            points = shape.vertices
        elif shape.joint == looks.parent[joint]:
            points = (shape.vertices - looks.origin[joint]) @ looks.rotation[joint]
        else:
            continue
        along = points @ axis
        radial = np.linalg.norm(points - along[:, None] * axis, axis=1)
        near = (np.abs(along) < 0.03 * looks.size) & (radial < 0.09 * looks.size)
        reach.append(radial[near])
    radii = np.concatenate([np.zeros(1), *reach])
    return float(np.clip(1.1 * np.quantile(radii, 0.9), 0.045 * looks.size, 0.085 * looks.size))


def _track(track: Track) -> dict[str, Any]:
    orientation = {} if track.orientation is None else {"orientation": _bytes(track.orientation, "<f4")}
    return {"name": track.name, "t": _bytes(track.t, "<f4")} | _quantised(track.q, "q") | orientation


def _quantised(values: FloatArray, name: str = "vertices") -> dict[str, Any]:
    """Columns in 16 bits each: ``low + step * number``."""
    low, high = values.min(axis=0), values.max(axis=0)
    step = np.maximum((high - low) / _LEVELS, 1e-12)
    return {name: _bytes(np.round((values - low) / step), "<u2"), "low": low.tolist(), "step": step.tolist()}


def _bytes(values: Any, kind: str) -> str:
    return b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _rounded(values: FloatArray, digits: int) -> list[float]:
    return [round(float(x), digits) + 0.0 for x in values]


def _or_null(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
