"""CollisionModel: the shapes of a robot. Beside robot_model.py the one file that calls pinocchio's algorithms and coal's."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from sysid_ros.exceptions import RobotModelError, in_a_line
from sysid_ros.robot.mesh_files import MeshFiles
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.urdf import lock_joints, read_urdf
from sysid_ros.sample import FloatArray

FLOOR = "floor"
"""Name of the floor in pairs."""

_HULL = " (convex)"
_POINT = 1e-3
"""Radius of a point [m]."""


@dataclass(frozen=True, slots=True)
class _Pair:
    """Two shapes (their indices) that must keep a clearance [m], by the names of their links."""

    shapes: tuple[int, int]
    links: tuple[str, str]
    clearance: float


class CollisionModel:
    """Distances between the links of a robot, and from a floor, by the ``<collision>`` shapes of its URDF.

    Meshes are replaced by their convex hulls, which lie around them: what is clear of the hulls is clear of the meshes. Where
    the hulls of two links touch at the reference posture and their meshes do not, the meshes are kept for that pair. Links that a
    joint connects are not compared, nor links that touch at the reference posture (0, or the middle of the range of a joint that
    can't be at 0): they are built that way, and named in the notes. A pair nearer there than twice the clearance has to keep half
    its distance at that posture instead. The links on the first joint need not be clear of the floor, if they touch it at the
    reference posture. A link without a shape is compared with the floor by the lines between its joints.

    Args:
        robot: the model; its joints are the columns of the gradients. Other joints are locked at 0.
        files: where meshes are looked for.
        clearance: what is kept between two links and above the floor [m].
        floor: height of the floor in the base frame [m]; None: there is none.
        ignored: pairs of links that are not compared.

    Attributes:
        pairs: names of the P pairs that are compared, :data:`FLOOR` among them.
        clearance: what each pair must keep, shape (P,) [m].
        notes: what was left out or assumed, a sentence each.

    Raises:
        RobotModelError: a pair to be ignored names a link that has no shape, or a mesh can't be read.
    """

    def __init__(
        self,
        robot: RobotModel,
        files: MeshFiles | None = None,
        clearance: float = 0.0,
        floor: float | None = None,
        ignored: Collection[tuple[str, str]] = (),
    ) -> None:
        self.robot = robot
        self._notes: list[str] = []
        self._geometry = self._shapes(files or MeshFiles())
        self._data = robot.model.createData()
        links = [robot.model.frames[o.parentFrame].name for o in self._geometry.geometryObjects]
        self._require_known(ignored, links)
        # the end of a joint's range may be a folded posture, in which links touch that are not built together
        lower, upper = robot.position_lower, robot.position_upper
        beyond = (lower > 0.0) | (upper < 0.0)
        reference = np.zeros(robot.n)
        reference[beyond] = 0.5 * (lower[beyond] + upper[beyond])
        pairs = self._self_pairs(links, {frozenset(pair) for pair in ignored}, reference, clearance)
        if floor is not None:
            pairs += [p for p in self._floor_pairs(links, floor, reference, clearance) if p.links not in ignored]
        self._set_pairs(pairs)
        self.pairs = tuple(p.links for p in pairs)
        self.clearance: FloatArray = np.array([p.clearance for p in pairs])
        self._reaches = np.array([self._reach(p.shapes) for p in pairs]).reshape(len(pairs), robot.n)
        self.notes = tuple(self._notes)

    def _shapes(self, files: MeshFiles) -> Any:
        """The shapes of the URDF on the joints of the robot; those whose mesh is not there are left out."""
        root = ElementTree.fromstring(read_urdf(self.robot.urdf, keep=("collision",))[2])
        missing, found = [], 0
        for link in root.iter("link"):
            for element in link.findall("collision"):
                mesh = element.find("geometry/mesh")
                path = files.find(mesh.get("filename", "")) if mesh is not None else None
                if mesh is None or path is not None:
                    found += 1
                    if mesh is not None:
                        mesh.set("filename", str(path))
                else:
                    missing.append(mesh.get("filename", ""))
                    link.remove(element)
        if missing:
            more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
            self._notes.append(
                f"Meshes are not on this machine, and their links are not checked for collisions: {missing[0]}{more}. Give the "
                "folder that holds the package with --package-path."
            )
        if not found and not missing:
            self._notes.append("The URDF has no collision shapes: collisions are not checked.")
        text = ElementTree.tostring(root, encoding="unicode")
        names = pin.buildModelFromXML(text).names[1:]
        text = lock_joints(text, [name for name in names if name not in self.robot.joint_names])
        try:
            shapes = pin.buildGeomFromUrdfString(pin.buildModelFromXML(text), text, pin.GeometryType.COLLISION, package_dirs=[])
        except (ValueError, RuntimeError) as error:
            raise RobotModelError(
                f"a collision mesh of the URDF can't be read: {in_a_line(error)}. Repair it, or take its <collision> out."
            ) from error
        return shapes

    def _require_known(self, ignored: Collection[tuple[str, str]], links: Sequence[str]) -> None:
        unknown = sorted({name for pair in ignored for name in pair if name not in (*links, FLOOR)})
        if unknown:
            raise RobotModelError(
                f"pairs to be ignored name {', '.join(unknown)}; the links with collision shapes are "
                f"{', '.join(dict.fromkeys(links)) or 'none'}."
            )

    def _self_pairs(
        self, links: Sequence[str], ignored: set[frozenset[str]], reference: FloatArray, clearance: float
    ) -> list[_Pair]:
        parent = [int(o.parentJoint) for o in self._geometry.geometryObjects]
        above = self.robot.model.parents
        candidates = [
            _Pair((a, b), (links[a], links[b]), clearance)
            for a in range(len(parent))
            for b in range(a + 1, len(parent))
            if parent[a] != parent[b]
            and above[parent[a]] != parent[b]
            and above[parent[b]] != parent[a]
            and frozenset((links[a], links[b])) not in ignored
        ]
        touching = self._distances_of(candidates, reference) <= 0.0
        if np.any(touching):
            names = dict.fromkeys(" and ".join(p.links) for p, t in zip(candidates, touching, strict=True) if t)
            self._notes.append(f"Links that touch at the reference posture are not compared: {'; '.join(names)}.")
        apart = [p for p, t in zip(candidates, touching, strict=True) if not t]
        hulls = self._add_hulls()
        hulled = [_Pair((hulls[p.shapes[0]], hulls[p.shapes[1]]), p.links, clearance) for p in apart]
        chosen = [
            hull if d > 0.0 else mesh for mesh, hull, d in zip(apart, hulled, self._distances_of(hulled, reference), strict=True)
        ]
        return self._near(chosen, reference)

    def _floor_pairs(self, links: Sequence[str], height: float, reference: FloatArray, clearance: float) -> list[_Pair]:
        ground = pin.GeometryObject("floor", 0, 0, pin.SE3.Identity(), coal.Halfspace(np.array([0.0, 0.0, 1.0]), float(height)))
        floor = self._geometry.addGeometryObject(ground)
        shapes = self._geometry.geometryObjects
        pairs = [_Pair((i, floor), (links[k], FLOOR), clearance) for i, k in self._source.items() if shapes[i].parentJoint > 0]
        pairs += [_Pair((i, floor), (name, FLOOR), clearance) for i, name in self._joint_points()]
        distances = self._distances_of(pairs, reference)
        standing = [d <= 0.0 and shapes[p.shapes[0]].parentJoint == 1 for p, d in zip(pairs, distances, strict=True)]
        if any(standing):
            names = ", ".join(dict.fromkeys(p.links[0] for p, s in zip(pairs, standing, strict=True) if s))
            self._notes.append(f"The first moving link stands in the floor and is not compared with it: {names}.")
        kept = [p for p, s in zip(pairs, standing, strict=True) if not s]
        return self._near(kept, reference, lambda pair: bool(shapes[pair.shapes[0]].parentJoint == 1))

    def _joint_points(self) -> list[tuple[int, str]]:
        """For links without a shape, points at their own joint and at those that they carry: index and name of the link."""
        model, points = self.robot.model, []
        shown = {int(o.parentJoint) for o in self._geometry.geometryObjects}
        bare = [j for j in range(1, model.njoints) if j not in shown]
        for joint in bare:
            name = self.robot.body_names[joint - 1]
            frame = self.robot.frame_id(name)
            for k, end in enumerate(
                [np.zeros(3)] + [model.jointPlacements[child].translation for child in model.children[joint]]
            ):
                point = pin.GeometryObject(f"{name} {k}", joint, frame, pin.SE3(np.eye(3), end), coal.Sphere(_POINT))
                points.append((self._geometry.addGeometryObject(point), name))
        if bare:
            names = ", ".join(self.robot.body_names[j - 1] for j in bare)
            self._notes.append(f"Kept above the floor by the lines between their joints only, for want of a shape: {names}.")
        return points

    def _near(
        self, pairs: list[_Pair], reference: FloatArray, concerned: Callable[[_Pair], bool] = lambda pair: True
    ) -> list[_Pair]:
        """The pairs, with less to keep where they are built near each other."""
        kept: list[_Pair] = []
        near: dict[tuple[str, str], float] = {}
        for pair, distance in zip(pairs, self._distances_of(pairs, reference), strict=True):
            if distance < 2.0 * pair.clearance and concerned(pair):
                kept.append(_Pair(pair.shapes, pair.links, 0.5 * float(distance)))
                near[pair.links] = min(5e2 * distance, near.get(pair.links, np.inf))
            else:
                kept.append(pair)
        if near:
            names = "; ".join(f"{' and '.join(links)} ({distance:.0f} mm)" for links, distance in near.items())
            self._notes.append(
                f"Near each other at the reference posture, and have to keep only half their distance there: {names}."
            )
        return kept

    def _add_hulls(self) -> list[int]:
        """Index of the convex shape that stands for each shape; primitives stand for themselves under a second name."""
        hulls = []
        self._source: dict[int, int] = {}
        for i in range(len(self._geometry.geometryObjects)):
            shape = self._geometry.geometryObjects[i]
            body = shape.geometry
            if isinstance(body, coal.BVHModelBase):
                body.buildConvexHull(True, "Qt")
                body = body.convex
            copy = pin.GeometryObject(f"{shape.name}{_HULL}", shape.parentJoint, shape.parentFrame, shape.placement, body)
            hulls.append(self._geometry.addGeometryObject(copy))
            self._source[hulls[-1]] = i
        return hulls

    def _set_pairs(self, pairs: Sequence[_Pair]) -> None:
        self._geometry.removeAllCollisionPairs()
        for pair in pairs:
            self._geometry.addCollisionPair(pin.CollisionPair(*pair.shapes))
        self._results = self._geometry.createData()

    def _distances_of(self, pairs: Sequence[_Pair], q: FloatArray) -> FloatArray:
        self._set_pairs(pairs)
        return self._distances(q)

    def _distances(self, q: FloatArray) -> FloatArray:
        pin.computeDistances(self.robot.model, self._data, self._geometry, self._results, q)
        return np.array([result.min_distance for result in self._results.distanceResults])

    def _reach(self, shapes: tuple[int, int]) -> FloatArray:
        """Speed that a unit of each joint's velocity can give one shape as seen from the other, at most, shape (n,) [m/rad]."""
        model = self.robot.model
        support = [set(model.supports[self._geometry.geometryObjects[s].parentJoint]) - {0} for s in shapes]
        rates = np.zeros(self.robot.n)
        for shape, own, other in zip(shapes, support, support[::-1], strict=True):
            body = self._geometry.geometryObjects[shape]
            body.geometry.computeLocalAABB()
            reach = float(np.linalg.norm(body.placement.translation))
            reach += float(body.geometry.aabb_radius + np.linalg.norm(body.geometry.aabb_center)) if own else 0.0
            for joint in sorted(own, reverse=True):
                slides = bool(self.robot.is_prismatic[joint - 1])
                limits = np.array([self.robot.position_lower[joint - 1], self.robot.position_upper[joint - 1]])
                reach += float(np.max(np.abs(limits))) if slides else 0.0
                if joint not in other:
                    rates[joint - 1] = 1.0 if slides else reach
                reach += float(np.linalg.norm(model.jointPlacements[joint].translation))
        return rates

    def room(self, q: FloatArray) -> FloatArray:
        """Distance of each pair less what it must keep, shape (P,) [m]; negative where it is violated."""
        return self._distances(q) - self.clearance

    def approach_rates(self, speed: FloatArray) -> FloatArray:
        """How fast each pair can come nearer while no joint is faster than ``speed``, shape (P,) [m/s]; speed has shape (n,)."""
        return np.asarray(self._reaches @ speed)

    def room_gradient(self, q: FloatArray, pairs: Collection[int]) -> FloatArray:
        """Derivative of :meth:`room` by q for some pairs (indices), shape (len(pairs), n); :meth:`room` has just run on q.

        With the nearest points p1 and p2 and the unit vector from the first to the second, ``dd = u' (J2(p2) - J1(p1)) dq``.
        """
        pin.computeJointJacobians(self.robot.model, self._data, q)
        gradient = np.zeros((len(pairs), self.robot.n))
        for row, k in enumerate(pairs):
            result = self._results.distanceResults[k]
            pair = self._geometry.collisionPairs[k]
            for sign, shape, point in (
                (-1.0, pair.first, result.getNearestPoint1()),
                (1.0, pair.second, result.getNearestPoint2()),
            ):
                joint = self._geometry.geometryObjects[shape].parentJoint
                if joint == 0:
                    continue
                jacobian = pin.getJointJacobian(self.robot.model, self._data, joint, pin.WORLD)
                gradient[row] += sign * (result.normal @ jacobian[:3] + _cross(point, result.normal) @ jacobian[3:])
        return gradient


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Of two vectors; numpy's own takes ten times as long."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
