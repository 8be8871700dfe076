"""mjcf_geoms: what a robot that is described for MuJoCo looks like."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot.mesh_reduction import Mesh, box, capsule, cylinder, moved
from sysid_ros.robot.mjcf import is_mjcf, link_of, read_mjcf, shift_of_link

_SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH = 2, 3, 4, 5, 6, 7
"""Types of geoms in MuJoCo that have an end."""
_SEEN_GROUPS = 3
"""MuJoCo's viewer shows the groups below; shapes for collisions are kept in the others."""
_NOT_STATED = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom that states none, for which its material's counts."""


@dataclass(frozen=True, eq=False)
class Geom:
    """A shape of a link.

    Attributes:
        link: of the URDF that :func:`.urdf_of_mjcf` makes. mesh: in the link's frame [m]. colour: "#RRGGBB", "" where none is
            stated. is_mesh: from a file of triangles.
    """

    link: str
    mesh: Mesh
    colour: str
    is_mesh: bool


def mjcf_geoms(path: Path | None) -> list[Geom]:
    """The geoms of all bodies but the world, as MuJoCo's viewer first shows them; of a body of which it shows none, all.

    Planes, height fields and what can't be seen through its colour are left out.

    Args:
        path: of an MJCF; nothing is found in other files, or where MuJoCo can't read it.
    """
    try:
        if path is None or not is_mjcf(path.read_text(encoding="utf-8")):
            return []
        model = read_mjcf(path)
    except (OSError, UnicodeDecodeError, RobotModelError):
        # a picture is no reason to fail: the robot is drawn as lines
        return []
    out = []
    for body in range(1, model.nbody):
        first = int(model.body_geomadr[body])
        every = [g for g in range(first, first + int(model.body_geomnum[body])) if _rgba(model, g)[3] > 0.0]
        seen = [g for g in every if int(model.geom_group[g]) < _SEEN_GROUPS]
        out += [geom for g in seen or every if (geom := _geom(model, body, g)) is not None]
    return out


def _geom(model: Any, body: int, g: int) -> Geom | None:
    mesh = _mesh(model, g)
    if mesh is None:
        return None
    rotation = pin.Quaternion(*model.geom_quat[g].tolist()).toRotationMatrix()
    rgba = _rgba(model, g)
    stated = tuple(rgba.tolist()) != _NOT_STATED
    colour = "#" + "".join(f"{round(255 * min(max(float(x), 0.0), 1.0)):02X}" for x in rgba[:3]) if stated else ""
    placed = moved(mesh, rotation, shift_of_link(model, body) + model.geom_pos[g])
    return Geom(link_of(model, body), placed, colour, int(model.geom_type[g]) >= _MESH)


def _mesh(model: Any, g: int) -> Mesh | None:
    """In the geom's own frame; None of what has no end."""
    size = np.array(model.geom_size[g])
    match int(model.geom_type[g]):
        case kind if kind == _SPHERE:
            return capsule(size[0], 0.0)
        case kind if kind == _CAPSULE:
            return capsule(size[0], 2.0 * size[1])
        case kind if kind == _ELLIPSOID:
            vertices, triangles = capsule(1.0, 0.0)
            return vertices * size, triangles
        case kind if kind == _CYLINDER:
            return cylinder(size[0], 2.0 * size[1])
        case kind if kind == _BOX:
            return box(2.0 * size)
        case kind if kind >= _MESH and int(model.geom_dataid[g]) >= 0:
            k = int(model.geom_dataid[g])
            vertices, triangles = (
                np.array(values[int(start[k]) : int(start[k]) + int(count[k])])
                for values, start, count in (
                    (model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum),
                    (model.mesh_face, model.mesh_faceadr, model.mesh_facenum),
                )
            )
            return vertices.astype(float), triangles.astype(np.int64)
    return None


def _rgba(model: Any, g: int) -> Any:
    """Colour that MuJoCo draws, shape (4,): the geom's own where it states one, else its material's."""
    own, material = np.array(model.geom_rgba[g], dtype=float), int(model.geom_matid[g])
    return np.array(model.mat_rgba[material], dtype=float) if material >= 0 and tuple(own.tolist()) == _NOT_STATED else own
