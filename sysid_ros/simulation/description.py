"""URDFs of the simulated arm and quadruped: texts that PyBullet and pinocchio read alike."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Sequence
from functools import lru_cache
from pathlib import Path

TIP_LINK = "lbr_iiwa_link_7"
"""The link that the last joint moves: the payload is fixed to it and expressed in its frame."""

HOME = (0.0, 0.5, 0.0, -1.2, 0.0, 0.9, 0.0)
"""Posture that the exciting motion swings about [rad]: bent, so that gravity loads every joint but the first."""

_BASE_MASS = "5.0"
_NOTICE = (
    " Links and joints of lbr_iiwa, Copyright (c) 2015, Robert Krug and Todor Stoyanov, AASS Research Center, Orebro University, "
    "Sweden; their terms stand in kuka_iiwa/model.urdf of pybullet_data. "
)

TRUNK = "trunk"
"""The floating link; the payload lies on it and is expressed in its frame."""

FEET = ("FR_toe", "FL_toe", "RR_toe", "RL_toe")
"""Links that touch the ground, spheres, in the order of the contact messages."""

IMU_LINK = "imu_link"
"""Link that the IMU messages are expressed in."""


@lru_cache(maxsize=1)
def arm_description() -> str:
    """URDF of the KUKA LBR iiwa of ``pybullet_data`` without meshes and without ``<dynamics>``.

    Meshes are left out: their paths hold only on the machine that has ``pybullet_data``, and nothing here collides.
    ``<dynamics>`` is left out because PyBullet would apply its damping and pinocchio would not; friction is an option of the
    simulation instead. The base gets back the 5 kg that the file's own comment names, because a mass of zero reads as a mistake;
    it is fixed, so nothing changes.
    """
    root = _plain("kuka_iiwa/model.urdf")
    base_mass = root.find("link/inertial/mass")
    if base_mass is not None:
        base_mass.set("value", _BASE_MASS)
    root.insert(0, ElementTree.Comment(_NOTICE))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


@lru_cache(maxsize=8)
def quadruped_description(imu_xyz: Sequence[float] = (0.0, 0.0, 0.0), imu_rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> str:
    """URDF of the Unitree A1 of ``pybullet_data`` without meshes; of its collision shapes only the feet's spheres stay.

    Its inertials are sound: every link's principal moments are positive and fulfil the triangle inequality, which the laikago's
    rounded ones and the mini cheetah's do not all do. Meshes are left out because their paths hold only on the machine that has
    ``pybullet_data``; shapes of the other links, so that nothing but the feet touches.

    Args:
        imu_xyz: place of the IMU in the trunk [m]. imu_rpy: how it is turned [rad], as in a URDF.
    """
    root = _plain("a1/a1.urdf", FEET)
    origin = root.find("joint[@name='imu_joint']/origin")
    assert origin is not None
    origin.set("xyz", " ".join(f"{x:g}" for x in imu_xyz))
    origin.set("rpy", " ".join(f"{x:g}" for x in imu_rpy))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _plain(name: str, touching: Collection[str] = ()) -> ElementTree.Element:
    """A file of ``pybullet_data`` without what its links look like and, but for ``touching``, touch with, and without joint
    dynamics."""
    import pybullet_data  # not needed where MuJoCo simulates

    root = ElementTree.parse(Path(pybullet_data.getDataPath()) / name).getroot()
    for tag in ("material", "transmission", "gazebo"):
        for element in root.findall(tag):
            root.remove(element)
    for part, tags in (("link", ("visual", "collision")), ("joint", ("dynamics",))):
        for parent in root.findall(part):
            for element in (e for tag in tags for e in parent.findall(tag)):
                if element.tag != "collision" or parent.get("name") not in touching:
                    parent.remove(element)
    return root
