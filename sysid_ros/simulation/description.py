"""URDF of the simulated arm: one text that PyBullet and pinocchio read alike."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from pathlib import Path

import pybullet_data

TIP_LINK = "lbr_iiwa_link_7"
"""The link that the last joint moves: the payload is fixed to it and expressed in its frame."""

HOME = (0.0, 0.5, 0.0, -1.2, 0.0, 0.9, 0.0)
"""Posture that the exciting motion swings about [rad]: bent, so that gravity loads every joint but the first."""

_BASE_MASS = "5.0"
_NOTICE = (
    " Links and joints of lbr_iiwa, Copyright (c) 2015, Robert Krug and Todor Stoyanov, AASS Research Center, Orebro University, "
    "Sweden; their terms stand in kuka_iiwa/model.urdf of pybullet_data. "
)


@lru_cache(maxsize=1)
def arm_description() -> str:
    """URDF of the KUKA LBR iiwa of ``pybullet_data`` without meshes and without ``<dynamics>``.

    Meshes are left out: their paths hold only on the machine that has ``pybullet_data``, and nothing here collides.
    ``<dynamics>`` is left out because PyBullet would apply its damping and pinocchio would not; friction is an option of the
    simulation instead. The base gets back the 5 kg that the file's own comment names, because a mass of zero reads as a mistake;
    it is fixed, so nothing changes.
    """
    path = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
    root = ElementTree.parse(path).getroot()
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    for joint in root.findall("joint"):
        for element in joint.findall("dynamics"):
            joint.remove(element)
    for material in root.findall("material"):
        root.remove(material)
    base_mass = root.find("link/inertial/mass")
    if base_mass is not None:
        base_mass.set("value", _BASE_MASS)
    root.insert(0, ElementTree.Comment(_NOTICE))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")
