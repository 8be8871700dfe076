"""LeggedRobot: a robot on legs as a simulation needs it: its description without meshes, its feet, and how it stands."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sysid_ros.exceptions import RobotModelError, SettingsError
from sysid_ros.floating.floating_base import FloatingBase, is_legged
from sysid_ros.floating.standing import leg_joints, standing_posture
from sysid_ros.robot.packaged import packaged
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray

IMU_LINK = "imu_link"
"""Link of the trunk that the IMU messages are expressed in."""
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
        if not is_legged(bare) or len(base.contact_frames) != 4:
            raise SettingsError(f"robot is {name}; it must stand on four legs of three joints, it has {bare.n} joints.")
        radius = np.where(base.radius_told, base.foot_radius, _SMALL_FOOT)
        _only_feet_touch(root, base, radius if spheres else np.zeros(4))
        _place_imu(root, base.trunk, imu_xyz, imu_rpy)
        urdf = ElementTree.tostring(root, encoding="unicode")
        base = FloatingBase(RobotModel.from_urdf(urdf), base.contact_frames)
        joints = leg_joints(base)
        posture = standing_posture(base, joints)
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
