"""An SDF (Gazebo, Drake) of a robot with what is known of it: links, damping and friction."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.files import write_text
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.rotation import rpy_of
from sysid_ros.sample import FloatArray
from sysid_ros.torque.exported import Holds, JointParameters, body, comment, known_of, not_held, require_bodies, words
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel

VERSION = "1.8"
"""Of the specification (sdformat.org): the first with all that is used here is 1.7; Gazebo since Fortress reads 1.8."""
_ABOUT = "Bodies, damping and friction as found; without shapes, and welded to the world."
_UNLIMITED = 1e5


def export_sdf(robot: RobotModel, model: ModelFile, path: Path) -> list[str]:
    """Write the SDF; what it can't hold or had to change, in words.

    Raises:
        ModelFileError: a link of the model is no body.
    """
    known = known_of(robot, model)
    require_bodies(known, model.source)
    notes = not_held(known, "An SDF", Holds.LINKS | Holds.DAMPING | Holds.FRICTION)
    write_text(path, sdf(known, notes))
    return notes


def sdf(known: TorqueModel, notes: Sequence[str] = ()) -> str:
    """The SDF of a robot with what the format holds of its torques.

    A link a joint, in the frame of that joint, with all that is fixed to it; the robot's other links are frames. The axis of a
    joint has ``<damping>`` and ``<friction>``; the format has no place for rotors. Links, joints and frames share their names in
    an SDF: a link or frame that is called as a joint gets ``_link`` behind its name.

    Args:
        notes: sentences for the comment at the top, about what the file does not hold.
    """
    robot, at = known.robot, known.robot.model
    root = ElementTree.Element("sdf", version=VERSION)
    root.append(ElementTree.Comment(comment([_ABOUT, *notes])))
    model = ElementTree.SubElement(root, "model", name=robot.name)
    called = {name: f"{name}_link" if name in robot.joint_names else name for name in (*robot.body_names, *robot.frame_names)}
    links = ["__model__", *(called[name] for name in robot.body_names)]
    has, described = (
        JointParameters.of(known),
        {str(e.get("name")): e for e in ElementTree.fromstring(robot.urdf).findall("joint")},
    )
    for j, (name, theta) in enumerate(zip(robot.joint_names, known.links().reshape(-1, 10), strict=True)):
        parent = links[at.parents[j + 1]]
        joint = ElementTree.SubElement(model, "joint", name=name, type="prismatic" if robot.is_prismatic[j] else "revolute")
        _pose(joint, at.jointPlacements[j + 1], parent)
        _text(joint, "parent", "world" if parent == "__model__" else parent)
        _text(joint, "child", links[j + 1])
        _axis(joint, robot, j, described[name].find("axis"), float(has.damping[j]), float(has.friction[j]))
        link = ElementTree.SubElement(model, "link", name=links[j + 1])
        ElementTree.SubElement(link, "pose", relative_to=name).text = "0 0 0 0 0 0"
        _inertial(link, theta)
    for frame in (name for name in robot.frame_names if name not in robot.body_names):
        placed = at.frames[robot.frame_id(frame)]
        element = ElementTree.SubElement(model, "frame", name=called[frame], attached_to=links[placed.parentJoint])
        _pose(element, placed.placement, links[placed.parentJoint])
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _axis(
    joint: ElementTree.Element, robot: RobotModel, j: int, axis: ElementTree.Element | None, damping: float, friction: float
) -> None:
    element = ElementTree.SubElement(joint, "axis")
    _text(element, "xyz", "1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
    limit = ElementTree.SubElement(element, "limit")
    for tag, value in (("lower", robot.position_lower[j]), ("upper", robot.position_upper[j])):
        if abs(value) < _UNLIMITED:  # else there is no limit, which is what an SDF means by saying nothing
            _text(limit, tag, repr(float(value)))
    for tag, value in (("effort", robot.effort_limit[j]), ("velocity", robot.velocity_limit[j])):
        if np.isfinite(value):
            _text(limit, tag, repr(float(value)))
    dynamics = ElementTree.SubElement(element, "dynamics")
    _text(dynamics, "damping", repr(damping))
    _text(dynamics, "friction", repr(friction))


def _inertial(link: ElementTree.Element, theta: FloatArray) -> None:
    mass, com, inertia = body(theta)
    inertial = ElementTree.SubElement(link, "inertial")
    _text(inertial, "pose", f"{words(com)} 0 0 0")
    _text(inertial, "mass", repr(mass))
    tensor = ElementTree.SubElement(inertial, "inertia")
    for tag, (i, j) in {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}.items():
        _text(tensor, tag, repr(float(inertia[i, j])))


def _pose(element: ElementTree.Element, at: Any, relative_to: str) -> None:
    pose = [*at.translation, *rpy_of(at.rotation)]
    ElementTree.SubElement(element, "pose", relative_to=relative_to).text = words(pose)


def _text(parent: ElementTree.Element, tag: str, text: str) -> None:
    ElementTree.SubElement(parent, tag).text = text
