"""appearance: what a robot looks like and how its joints move it, in plain arrays for whoever draws it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from sysid_ros.robot.mesh_files import MeshFiles
from sysid_ros.robot.mesh_reduction import Mesh, Triangles, along, box, capsule, cone, cylinder, moved, reduced
from sysid_ros.robot.mjcf_geoms import Geom
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.urdf import lock_joints, read_urdf
from sysid_ros.sample import FloatArray

_FINENESS = 1.0 / 170.0
"""Edge of a cell in which vertices are drawn together, as a part of the robot's size: a pixel or two of a picture of it."""
_MOST_VERTICES = 900
"""Of one shape: what all links of an arm hold is then some 200 kB on a page."""
_THICK = 0.022
"""Radius of a link that is drawn as a line between joints, as a part of the robot's size."""
_PLAIN = "#A9B1BC"


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles that move with a joint.

    Attributes:
        joint: index of the joint that moves it, -1 for the base. vertices: in the frame of that joint, shape (V, 3) [m].
        triangles: shape (T, 3). colour: "#RRGGBB".
    """

    joint: int
    vertices: FloatArray
    triangles: Triangles
    colour: str = _PLAIN


@dataclass(frozen=True, eq=False)
class Appearance:
    """A robot to be drawn.

    The frame of joint j in the base is ``T_j = T_parent(j) (rotation_j, origin_j) motion_j(q_j)``, where the motion is a turn by
    q_j about ``axis_j``, or a shift by q_j along it where ``slides_j``.

    Attributes:
        joint_names: n. parent: index of the joint before it, -1 for the base, shape (n,). rotation: shape (n, 3, 3).
        origin: shape (n, 3) [m]. axis: unit vectors in the joint's own frame, shape (n, 3). slides: shape (n,), bool.
        shapes: of all links. size: of the robot [m]. source: "meshes", "shapes" or "lines", what most links are
            drawn by.
    """

    joint_names: tuple[str, ...]
    parent: tuple[int, ...]
    rotation: FloatArray
    origin: FloatArray
    axis: FloatArray
    slides: tuple[bool, ...]
    shapes: tuple[Shape, ...]
    size: float
    source: str


def appearance(robot: RobotModel, files: MeshFiles | None = None, geoms: Sequence[Geom] = ()) -> Appearance:
    """How to draw a robot: the visual shapes of its URDF, or the geoms of its MJCF, meshes with fewer triangles; the collision
    shapes of links that have no visual one on this machine; and capsules between the joints of those that have neither, or only
    small ones.

    Args:
        files: where meshes are looked for. geoms: from :func:`.mjcf_geoms`.
    """
    model = robot.model
    data = model.createData()
    pin.forwardKinematics(model, data, np.zeros(robot.n))
    size = _size(model, data)
    shapes: list[Shape] = []
    sources: dict[int, str] = {}
    shown: set[int] = set()
    for kind in ("geom", "visual", "collision"):
        found = _given(robot, geoms, size) if kind == "geom" else _stated(robot, files or MeshFiles(), kind, size, shown)
        for shape, source in found:
            shapes.append(shape)
            sources[shape.joint] = max(source, sources.get(shape.joint, ""))
        shown |= {shape.joint for shape in shapes}
    axes = [_axis(model, j + 1) for j in range(robot.n)]
    for j in range(-1, robot.n):
        ends = _ends(model, j, size)
        if not _reached(shapes, j, ends):
            sources[j] = "lines"
            shapes.append(_line(j, ends, axes[j] if j >= 0 else np.array([0.0, 0.0, 1.0]), size))
    placements = [model.jointPlacements[j + 1] for j in range(robot.n)]
    return Appearance(
        robot.joint_names,
        tuple(int(model.parents[j + 1]) - 1 for j in range(robot.n)),
        np.array([p.rotation for p in placements]),
        np.array([p.translation for p in placements]),
        np.array(axes),
        tuple(bool(x) for x in robot.is_prismatic),
        tuple(shape for shape in shapes if len(shape.triangles)),
        size,
        max(("lines", "shapes", "meshes"), key=lambda source: sum(s == source for s in sources.values())),
    )


def in_joint(robot: RobotModel, frame: str) -> tuple[int, FloatArray, FloatArray]:
    """The joint that moves a link (index, -1 for the base), and the link's rotation (3, 3) and origin (3,) in its frame [m]."""
    placed = robot.model.frames[robot.frame_id(frame)]
    return int(placed.parentJoint) - 1, np.array(placed.placement.rotation), np.array(placed.placement.translation)


def _axis(model: Any, joint: int) -> FloatArray:
    """Of a joint, in its own frame, from its motion subspace."""
    own = model.joints[joint].createData()
    model.joints[joint].calc(own, np.zeros(model.nq))
    subspace = np.asarray(own.S).reshape(6)
    axis = subspace[3:] if np.any(subspace[3:]) else subspace[:3]
    return np.asarray(axis / np.linalg.norm(axis))


def _size(model: Any, data: Any) -> float:
    """Edge of the box about all joints and frames at 0, and of what they can reach stretched out, at least 0.1 [m]."""
    pin.updateFramePlacements(model, data)
    places = np.array([np.zeros(3), *(p.translation for p in data.oMf), *(p.translation for p in data.oMi)])
    return max(float(np.ptp(places, axis=0).max()), 0.1)


def _given(robot: RobotModel, geoms: Sequence[Geom], size: float) -> Iterator[tuple[Shape, str]]:
    """The geoms of an MJCF, and whether each is a mesh."""
    for geom in geoms:
        if geom.link in robot.frame_names:
            joint, rotation, translation = in_joint(robot, geom.link)
            mesh = reduced(geom.mesh, _FINENESS * size, _MOST_VERTICES) if geom.is_mesh else geom.mesh
            yield Shape(joint, *moved(mesh, rotation, translation), geom.colour or _PLAIN), "meshes" if geom.is_mesh else "shapes"


def _stated(robot: RobotModel, files: MeshFiles, kind: str, size: float, shown: set[int]) -> Iterator[tuple[Shape, str]]:
    """The visual or collision shapes of the URDF on joints that are not shown yet, and whether each is a mesh."""
    geometry = _geometry(robot, files, kind)
    for stated in geometry.geometryObjects if geometry is not None else ():
        joint = int(stated.parentJoint) - 1
        if joint in shown:
            continue
        mesh, source = _triangles(stated)
        rotation, translation = np.array(stated.placement.rotation), np.array(stated.placement.translation)
        vertices, triangles = moved(
            reduced(mesh, _FINENESS * size, _MOST_VERTICES) if source == "meshes" else mesh, rotation, translation
        )
        if len(triangles):
            yield Shape(joint, vertices, triangles, _colour(stated) if kind == "visual" else _PLAIN), source


def _geometry(robot: RobotModel, files: MeshFiles, kind: str) -> Any | None:
    """pinocchio's shapes of one kind; those whose mesh is not there are left out, None where none can be read."""
    root = ElementTree.fromstring(read_urdf(robot.urdf, keep=(kind,))[2])
    for link in root.iter("link"):
        for element in link.findall(kind):
            mesh = element.find("geometry/mesh")
            path = None if mesh is None else files.find(mesh.get("filename", ""))
            if mesh is not None and path is not None:
                mesh.set("filename", str(path))
            elif mesh is not None:
                link.remove(element)
    text = ElementTree.tostring(root, encoding="unicode")
    names = pin.buildModelFromXML(text).names[1:]
    text = lock_joints(text, [name for name in names if name not in robot.joint_names])
    wanted = pin.GeometryType.VISUAL if kind == "visual" else pin.GeometryType.COLLISION
    try:
        return pin.buildGeomFromUrdfString(pin.buildModelFromXML(text), text, wanted, package_dirs=[])
    except (ValueError, RuntimeError):
        # a picture is no reason to fail: what can't be read is drawn as lines
        return None


def _triangles(stated: Any) -> tuple[Mesh, str]:
    shape = stated.geometry
    match shape:
        case coal.Box():
            return box(2.0 * np.asarray(shape.halfSide)), "shapes"
        case coal.Sphere():
            return capsule(float(shape.radius), 0.0), "shapes"
        case coal.Cylinder():
            return cylinder(float(shape.radius), 2.0 * float(shape.halfLength)), "shapes"
        case coal.Capsule():
            return capsule(float(shape.radius), 2.0 * float(shape.halfLength)), "shapes"
        case coal.Cone():
            return cone(float(shape.radius), 2.0 * float(shape.halfLength)), "shapes"
        case coal.BVHModelBase():
            vertices = np.array(shape.vertices())
            triangles = np.array([[t[0], t[1], t[2]] for t in map(shape.tri_indices, range(shape.num_tris))], dtype=np.int64)
            return (vertices, triangles.reshape(-1, 3)), "meshes"
    return (np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)), "shapes"


def _colour(stated: Any) -> str:
    """As stated in the URDF, plain where it states none."""
    if not stated.overrideMaterial:
        return _PLAIN
    red, green, blue = (round(255 * min(max(float(x), 0.0), 1.0)) for x in np.asarray(stated.meshColor).ravel()[:3])
    return f"#{red:02X}{green:02X}{blue:02X}"


def _ends(model: Any, joint: int, size: float) -> list[FloatArray]:
    """Where a link without a shape goes to from its joint: to the joints that it carries, or to its farthest frame."""
    ends = [np.array(model.jointPlacements[int(k)].translation) for k in model.children[joint + 1]]
    if not ends:
        frames = [np.array(f.placement.translation) for f in model.frames if int(f.parentJoint) == joint + 1]
        ends = [max(frames, key=lambda p: float(np.linalg.norm(p)))] if frames else [np.zeros(3)]
        if joint >= 0 and np.linalg.norm(ends[0]) < _THICK * size:
            ends = [np.array(model.inertias[joint + 1].lever)]
    return ends


def _reached(shapes: list[Shape], joint: int, ends: list[FloatArray]) -> bool:
    """Whether the shapes of a link are half as large as it is long: a foot alone is no leg."""
    own = [s.vertices for s in shapes if s.joint == joint]
    length = max(float(np.linalg.norm(end)) for end in ends)
    return bool(own) and float(np.linalg.norm(np.ptp(np.concatenate(own), axis=0))) >= 0.5 * length


def _line(joint: int, ends: list[FloatArray], axis: FloatArray, size: float) -> Shape:
    """Capsules from a joint to these points, and the joint itself as a short cylinder along its axis."""
    radius = _THICK * size
    meshes = [along(np.zeros(3), end, radius) for end in ends]
    if joint >= 0:
        half = 1.7 * radius * axis
        meshes.append(along(-half, half, 1.5 * radius, flat=True))
    starts = np.cumsum([0, *(len(v) for v, _ in meshes)])
    triangles = np.concatenate([t + start for (_, t), start in zip(meshes, starts, strict=False)])
    return Shape(joint, np.concatenate([v for v, _ in meshes]), triangles)


def files_of(urdf: Path | None) -> MeshFiles:
    """Where the meshes of a URDF file are looked for."""
    return MeshFiles(urdf.parent if urdf is not None else None)
