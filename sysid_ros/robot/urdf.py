"""The text of a URDF, read and prepared for pinocchio."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Sequence

import numpy as np

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot.urdf_check import check_urdf
from sysid_ros.sample import FloatArray

_MOVABLE = ("revolute", "continuous", "prismatic")


def read_urdf(urdf: str, keep: Sequence[str] = ()) -> tuple[dict[str, str], set[str], str]:
    """Movable joint types, mimic joints, and the URDF with continuous joints as revolute ones and without its shapes.

    pinocchio gives a continuous joint two coordinates; an angle that grows without limit is the same joint with one.

    Args:
        keep: "visual", "collision": the shapes that are not taken out.
    """
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise RobotModelError(
            f"the URDF is not well-formed XML: {error}. Give a URDF (run xacro first if it is a .xacro)."
        ) from error
    if root.tag != "robot":
        raise RobotModelError(f"the URDF's root element is <{root.tag}>; it must be <robot>. Give a URDF or an MJCF.")
    check_urdf(root)
    types: dict[str, str] = {}
    mimic: set[str] = set()
    for joint in root.findall("joint"):
        kind, name = joint.get("type"), joint.get("name")
        if kind not in _MOVABLE or name is None:
            continue
        types[name] = kind
        if joint.find("mimic") is not None:
            mimic.add(name)
        if kind == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
            limit.set("lower", "-1e6")
            limit.set("upper", "1e6")
            limit.set("effort", limit.get("effort", "0"))
            limit.set("velocity", limit.get("velocity", "0"))
    for tag in {"visual", "collision"} - set(keep):
        for link in root.iter("link"):
            for element in link.findall(tag):
                link.remove(element)
    return types, mimic, ElementTree.tostring(root, encoding="unicode")


def stated_armatures(urdf: str, names: Sequence[str]) -> FloatArray:
    """Rotor inertia of each joint, shape (n,) [kg m^2]: the attribute ``armature`` of ``<dynamics>``, which a URDF made of
    an MJCF has; 0 where there is none."""
    joints = {str(joint.get("name")): joint.find("dynamics") for joint in ElementTree.fromstring(urdf).findall("joint")}
    found = [joints.get(name) for name in names]
    return np.array([0.0 if dynamics is None else float(dynamics.get("armature", 0.0)) for dynamics in found])


def lock_joints(urdf: str, names: Collection[str]) -> str:
    """The URDF's text with these joints fixed at 0.

    Done in the text, since pinocchio can't lock a joint of a built model where a link has a joint's name.
    """
    root = ElementTree.fromstring(urdf)
    for joint in root.findall("joint"):
        if joint.get("name") in names:
            joint.set("type", "fixed")
            for tag in ("axis", "limit", "dynamics", "mimic"):
                for element in joint.findall(tag):
                    joint.remove(element)
    return ElementTree.tostring(root, encoding="unicode")
