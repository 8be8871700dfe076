"""LeggedRobot: a robot on legs as a simulation needs it: its description without meshes, its feet, and how it stands."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sysid_ros.exceptions import RobotModelError, SettingsError
from sysid_ros.floating.contact_kinematics import ContactKinematics
from sysid_ros.floating.floating_base import FloatingBase, is_legged
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray

IMU_LINK = "imu_link"
"""Link of the trunk that the IMU messages are expressed in."""
_BENT = 0.72
"""Height of the hips over the feet as a part of a leg's full length."""
_POSTURES = 4000
_SMALL_FOOT = 0.022
"""Radius of feet whose URDF has no sphere for them [m], that of most robots of a man's knee height."""


@dataclass(frozen=True, slots=True)
class LeggedRobot:
    """What a simulation knows of a robot with legs of three joints.

    Attributes:
        urdf: its description as a recording tells it, of whose shapes at most the feet's spheres are left. base: the robot.
        radius: of the feet, also where the description does not tell it, shape (k,) [m].
        leg_joints: columns of each leg among the measured joints, shape (k, 3).
        posture: joint positions of standing, shape (n,) [rad]. height: of the trunk's origin over the ground then [m].
        feet: contact points then, in the trunk's axes, shape (k, 3) [m].
    """

    urdf: str
    base: FloatingBase
    radius: FloatArray
    leg_joints: np.ndarray[tuple[int, int], np.dtype[np.intp]]
    posture: FloatArray
    height: float
    feet: FloatArray

    @classmethod
    def of(cls, name: str, imu_xyz: Sequence[float], imu_rpy: Sequence[float], spheres: bool) -> LeggedRobot:
        """A robot by its name among the packaged ones, or by the path of its URDF, with an IMU somewhere in its trunk.

        Args:
            imu_xyz, imu_rpy: where the description says that the IMU sits in the trunk [m], and how it is turned [rad].
            spheres: whether the description tells what the feet are.

        Raises:
            SettingsError: there is no such robot, or it does not stand on four legs of three joints.
        """
        path = Path(name) if name.endswith(".urdf") else packaged(name)
        if path is None or not path.is_file():
            raise SettingsError(
                f"robot is {name}; it must be the name of a robot of example-robot-data (pip install example-robot-data), such "
                "as those of its folders *_description, or the path of a URDF."
            )
        root = _without_meshes(ElementTree.parse(path).getroot())
        bare = RobotModel.from_urdf(ElementTree.tostring(root, encoding="unicode"))
        try:
            base = FloatingBase(bare)
        except RobotModelError as error:
            raise SettingsError(f"robot is {name}; it must stand on legs: {error}") from None
        legs = [np.flatnonzero(carried[FREE:]) for carried in base.contacts.carriers]
        if not is_legged(bare) or len(legs) != 4 or any(leg.size != 3 for leg in legs):
            raise SettingsError(f"robot is {name}; it must stand on four legs of three joints, it has {bare.n} joints.")
        radius = np.where(base.radius_told, base.foot_radius, _SMALL_FOOT)
        _only_feet_touch(root, base, radius if spheres else np.zeros(4))
        _place_imu(root, base.trunk, imu_xyz, imu_rpy)
        urdf = ElementTree.tostring(root, encoding="unicode")
        base = FloatingBase(RobotModel.from_urdf(urdf), base.contact_frames)
        joints = np.array(legs)
        posture = _standing(base, joints)
        centres, _ = base.contacts.origins(np.concatenate([np.zeros(FREE), posture]))
        feet = centres - np.outer(radius, [0.0, 0.0, 1.0])
        return cls(urdf, base, radius, joints, posture, float(-feet[:, 2].mean()), feet)


def _without_meshes(root: ElementTree.Element) -> ElementTree.Element:
    """The description without what its links look like, with shapes that are spheres, and without joint dynamics."""
    for tag in ("material", "transmission", "gazebo"):
        for element in root.findall(tag):
            root.remove(element)
    for link in root.findall("link"):
        for element in [*link.findall("visual"), *link.findall("collision")]:
            if element.tag == "visual" or element.find("geometry/sphere") is None:
                link.remove(element)
    for joint in root.findall("joint"):
        for element in joint.findall("dynamics"):
            joint.remove(element)
    return root


def _only_feet_touch(root: ElementTree.Element, base: FloatingBase, radius: FloatArray) -> None:
    """Shapes are left to feet alone, spheres of these radii, shape (k,) [m]; none of a radius of 0."""
    for link in root.findall("link"):
        name = link.get("name")
        foot = base.contact_frames.index(name) if name in base.contact_frames else -1
        shapes = link.findall("collision")
        if foot < 0 or radius[foot] == 0.0:
            for element in shapes:
                link.remove(element)
        elif not shapes:
            geometry = ElementTree.SubElement(ElementTree.SubElement(link, "collision"), "geometry")
            ElementTree.SubElement(geometry, "sphere", radius=f"{radius[foot]:g}")


def _place_imu(root: ElementTree.Element, trunk: str, xyz: Sequence[float], rpy: Sequence[float]) -> None:
    """The IMU is a link of the trunk."""
    old = {str(joint.find("child").get("link")): joint for joint in root.findall("joint")}  # type: ignore[union-attr]
    if IMU_LINK in old:
        root.remove(old[IMU_LINK])
    else:
        ElementTree.SubElement(root, "link", name=IMU_LINK)
    joint = ElementTree.SubElement(root, "joint", name="imu_joint_of_simulation", type="fixed")
    ElementTree.SubElement(joint, "parent", link=trunk)
    ElementTree.SubElement(joint, "child", link=IMU_LINK)
    place = {"xyz": " ".join(f"{x:g}" for x in xyz), "rpy": " ".join(f"{x:g}" for x in rpy)}
    ElementTree.SubElement(joint, "origin", place)
    ElementTree.indent(root)


def _standing(base: FloatingBase, joints: np.ndarray[tuple[int, int], np.dtype[np.intp]]) -> FloatArray:
    """Positions (n,) of legs that are bent alike, each foot below its second joint."""
    robot, legs = base.robot, base.legs
    rng = np.random.default_rng(0)
    low, high = np.maximum(legs.position_lower, -2.6), np.minimum(legs.position_upper, 2.6)
    q = rng.uniform(low, high, (_POSTURES, legs.n))
    second = ContactKinematics(robot, [legs.body_names[leg[1]] for leg in joints])
    feet, hips = np.empty((_POSTURES, 4, 3)), np.empty((_POSTURES, 4, 3))
    for k, positions in enumerate(q):
        whole = np.concatenate([np.zeros(FREE), positions])
        feet[k], hips[k] = base.contacts.origins(whole)[0], second.origins(whole)[0]
    length = np.linalg.norm(feet - hips, axis=2).max(axis=0)
    neutral = second.origins(np.zeros(robot.n))[0]
    side = base.contacts.origins(np.zeros(robot.n))[0][:, 1]
    goal = np.column_stack([neutral[:, 0], side, neutral[:, 2] - _BENT * length])
    out = np.zeros(legs.n)
    for i, leg in enumerate(joints):
        cost = np.linalg.norm(feet[:, i] - goal[i], axis=1) / length[i] + 0.2 * np.abs(q[:, leg[0]])
        # of two ways to bend a knee the same for all
        out[leg] = q[np.argmin(cost + 0.05 * np.sign(q[:, leg[2]])), leg]
    return inverse(base, joints, out, goal)


def inverse(
    base: FloatingBase, joints: np.ndarray[tuple[int, int], np.dtype[np.intp]], q: FloatArray, goal: FloatArray, steps: int = 100
) -> FloatArray:
    """Joint positions (n,) near q that put the centres of the feet at ``goal`` (k, 3) [m] in the trunk, as near as they can."""
    q = q.copy()
    for _ in range(steps):
        centres, jacobians = base.contacts.jacobians(np.concatenate([np.zeros(FREE), q]))
        error = goal - centres
        for i, leg in enumerate(joints):
            J = jacobians[i, :3, FREE + leg].T
            q[leg] += np.clip(J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(3), error[i]), -0.2, 0.2)
        if np.abs(error).max() < 1e-7:
            break
    return q
