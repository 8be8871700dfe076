"""URDF of the simulated quadruped: one text that PyBullet and pinocchio read alike."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import pybullet_data

TRUNK = "trunk"
"""The floating link; the payload lies on it and is expressed in its frame."""

FEET = ("FR_toe", "FL_toe", "RR_toe", "RL_toe")
"""Links that touch the ground, spheres, in the order of the contact messages."""

IMU_LINK = "imu_link"
"""Link that the IMU messages are expressed in."""

BACK = 0.057
"""Height of the back above the trunk's origin [m]."""


@lru_cache(maxsize=8)
def quadruped_description(imu_xyz: Sequence[float] = (0.0, 0.0, 0.0), imu_rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> str:
    """URDF of the Unitree A1 of ``pybullet_data`` without meshes; of its collision shapes only the feet's spheres stay.

    Its inertials are sound: every link's principal moments are positive and fulfil the triangle inequality, which the laikago's
    rounded ones and the mini cheetah's do not all do. Meshes are left out because their paths hold only on the machine that has
    ``pybullet_data``; shapes of the other links, so that nothing but the feet touches.

    Args:
        imu_xyz: place of the IMU in the trunk [m]. imu_rpy: how it is turned [rad], as in a URDF.
    """
    path = Path(pybullet_data.getDataPath()) / "a1" / "a1.urdf"
    root = ElementTree.parse(path).getroot()
    for link in root.findall("link"):
        tags = ("visual",) if link.get("name") in FEET else ("visual", "collision")
        for tag in tags:
            for element in link.findall(tag):
                link.remove(element)
    for tag in ("material", "transmission", "gazebo"):
        for element in root.findall(tag):
            root.remove(element)
    for joint in root.findall("joint"):
        for element in joint.findall("dynamics"):
            joint.remove(element)
    origin = root.find("joint[@name='imu_joint']/origin")
    assert origin is not None
    origin.set("xyz", " ".join(f"{x:g}" for x in imu_xyz))
    origin.set("rpy", " ".join(f"{x:g}" for x in imu_rpy))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")
