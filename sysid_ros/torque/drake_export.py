"""A URDF for Drake: that of :mod:`sysid_ros.torque.urdf_export`, with the rotors that Drake reads beside it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from sysid_ros.files import write_text
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.torque.exported import Holds, JointParameters, known_of
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.urdf_export import check_urdf, identified_urdf, with_comment

NAMESPACE = "http://drake.mit.edu"
_DRY = (
    "Drake reads the damping of <dynamics> and leaves its friction out: add the torque -friction sign(v) of each joint by a "
    "system of your own."
)


def export_drake(robot: RobotModel, model: ModelFile, path: Path) -> list[str]:
    """Write the URDF and check it; what it can't hold or had to change, in words.

    Raises:
        ModelFileError: the model is not physical, or the URDF read back is another robot.
    """
    text, notes = drake_urdf(robot, model)
    check_urdf(robot, model, text)
    write_text(path, text)
    return notes


def drake_urdf(robot: RobotModel, model: ModelFile) -> tuple[str, list[str]]:
    """The identified URDF with an actuator a joint, and notes about it.

    ``drake:rotor_inertia`` is the motor's inertia as seen at the joint, with a ``drake:gear_ratio`` of 1: Drake adds their
    product ``rotor_inertia gear_ratio^2`` to the joint's own inertia. A joint's other transmissions are left out, which would add
    to it, and so is an effort limit of zero, with which Drake takes no actuator.

    Raises:
        ModelFileError: the model belongs to another robot or a link of it is no body.
    """
    known = known_of(robot, model)
    has = JointParameters.of(known)
    plain, merged = identified_urdf(robot, model, Holds.LINKS | Holds.DAMPING | Holds.FRICTION | Holds.ARMATURE)
    notes = merged + ([_DRY] if np.any(has.friction) else [])
    root = ElementTree.fromstring(plain, ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True)))
    for old in root.findall("transmission"):
        if any(joint.get("name") in robot.joint_names for joint in old.findall("joint")):
            root.remove(old)
    joints = {str(joint.get("name")): joint for joint in root.findall("joint")}
    for name, armature in zip(robot.joint_names, has.armature, strict=True):
        limit = joints[name].find("limit")
        if limit is not None and not float(limit.get("effort", "0")) > 0.0:
            limit.attrib.pop("effort", None)
        transmission = ElementTree.SubElement(root, "transmission", name=f"{name}_transmission")
        ElementTree.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
        ElementTree.SubElement(transmission, "joint", name=name)
        actuator = ElementTree.SubElement(transmission, "actuator", name=f"{name}_motor")
        ElementTree.SubElement(actuator, f"{{{NAMESPACE}}}rotor_inertia", value=repr(float(armature)))
        ElementTree.SubElement(actuator, f"{{{NAMESPACE}}}gear_ratio", value="1")
        ElementTree.indent(transmission, "  ", level=1)
        transmission.tail = "\n"
    ElementTree.register_namespace("drake", NAMESPACE)
    head = plain[: plain.index("<robot")]
    return with_comment(head + ElementTree.tostring(root, encoding="unicode") + "\n", ["For Drake.", *notes]), notes
