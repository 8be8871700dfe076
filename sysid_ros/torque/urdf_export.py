"""A URDF with the identified link inertials and joint dynamics, checked by loading it again."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sysid_ros.exceptions import ModelFileError
from sysid_ros.files import write_text
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.rotation import rotation_of
from sysid_ros.robot.smoothed_sign import smoothed_sign
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.exported import Holds, comment, known_of, not_held
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel

_AXES = ("ixx", "ixy", "iyy", "ixz", "iyz", "izz")
_MOVABLE = ("revolute", "continuous", "prismatic")
_ROUNDING = 1e-9
_HEAD = r"\s*(?:<\?xml.*?\?>)?\s*((?:<!--.*?-->\s*)*)"
_HOLDS = Holds.LINKS | Holds.DAMPING | Holds.FRICTION


@dataclass(frozen=True, slots=True)
class _Attached:
    """A link that a joint carries beside the one that it moves: ``theta`` (10,) in the frame of the joint."""

    name: str
    locked: bool
    theta: FloatArray


def export_urdf(robot: RobotModel, model: ModelFile, path: Path, base: FloatingBase | None = None) -> list[str]:
    """Write the URDF and check it; what it can't hold or had to change, in words.

    Args:
        robot: of the model. model: what was found. path: to write. base: where the robot hangs on its floating base.

    Raises:
        ModelFileError: the model is not physical, or the URDF read back is another robot.
    """
    text, notes = identified_urdf(robot, model, base=base)
    check_urdf(robot, model, text)
    text = base.unhung(text) + "\n" if base else text
    write_text(path, with_comment(text, notes) if notes else text)
    return notes


def with_comment(text: str, sentences: Sequence[str]) -> str:
    """A URDF's text with sentences in a comment above the robot, below the comments that stand there."""
    head = re.match(_HEAD, text, re.DOTALL)
    end = head.end() if head else 0
    return f"{text[:end]}<!--{comment(sentences)}-->\n{text[end:]}"


def identified_urdf(
    robot: RobotModel, model: ModelFile, holds: Holds = _HOLDS, base: FloatingBase | None = None
) -> tuple[str, list[str]]:
    """The robot's URDF with the model's link inertials, damping and friction, and notes about it.

    Motion tells what moves as one piece. Where a joint carries several links, through fixed joints or joints locked at 0, those
    keep the URDF's inertials and the identified link gets the rest, if that is a body that can exist; else they lose their mass
    to it, and a note says so. Inertias are written about the centre of mass, along the axes of the link.

    Args:
        holds: what its readers take from it and from what is added to it. base: as of :func:`export_urdf`.

    Raises:
        ModelFileError: the model belongs to another robot or a link of it is no body.
    """
    known = known_of(robot, model)
    links, damping, friction = known.links(), known.damping(), known.dry_friction()
    root = ElementTree.fromstring(robot.urdf, ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True)))
    by_name = {str(link.get("name")): link for link in root.findall("link")}
    notes = []
    for j, body in enumerate(robot.body_names):
        theta = links[10 * j : 10 * j + 10]
        if base is not None and not np.any(theta):
            continue  # what the trunk hangs on
        if not inertial_parameters.is_physical(theta):
            raise ModelFileError(
                f"the inertials of link '{body}' in {model.source} belong to no body (mass {theta[0]:.3g} kg), and simulators "
                "take bodies only. Identify with physical consistency."
            )
        attached = _attached(robot, root, j)
        kept = _kept(theta, attached)
        _set_inertial(by_name[body], theta - np.sum([a.theta for a in kept], axis=0) if kept else theta)
        merged = [a for a in attached if a not in kept]
        for link in merged:
            _set_inertial(by_name[link.name], None)
        if merged:
            names = ", ".join(f"{a.name} ({a.theta[0]:.3g} kg)" for a in merged)
            notes.append(f"Merged into link {body}, and now without mass: {names}.")
        if any(a.locked for a in merged):
            notes.append(f"Links of locked joints are among those merged into {body}: keep these joints locked in a simulation.")
        if kept:
            notes.append(f"Kept as the URDF has them, and subtracted from link {body}: {', '.join(a.name for a in kept)}.")
    for j, name in enumerate(robot.joint_names):
        joint = next(e for e in root.findall("joint") if e.get("name") == name)
        dynamics = joint.find("dynamics")
        if dynamics is None:
            dynamics = ElementTree.SubElement(joint, "dynamics")
        dynamics.set("damping", repr(float(max(damping[j], 0.0))))
        dynamics.set("friction", repr(float(max(friction[j], 0.0))))
        if "armature" in dynamics.attrib:  # of a URDF made of an MJCF, which this package alone reads
            dynamics.set("armature", repr(float(max(known.armature()[j], 0.0))))
    notes += not_held(known, "A URDF", holds)
    comments = re.match(_HEAD, robot.urdf, re.DOTALL)
    head = '<?xml version="1.0" encoding="utf-8"?>\n' + (comments.group(1) if comments else "")
    return head + ElementTree.tostring(root, encoding="unicode") + "\n", notes


def check_urdf(robot: RobotModel, model: ModelFile, text: str) -> None:
    """Load a URDF and compare its torques with the model's, in random states of the robot.

    Raises:
        ModelFileError: they differ by more than rounding.
    """
    known = known_of(robot, model)
    links, damping, friction = known.links(), np.maximum(known.damping(), 0.0), np.maximum(known.dry_friction(), 0.0)
    again = RobotModel.from_urdf(text, robot.joint_names, tuple(robot.gravity))
    stated = np.array(again.model.armature)
    rng = np.random.default_rng(0)
    low, high = np.maximum(robot.position_lower, -np.pi), np.minimum(robot.position_upper, np.pi)
    worst = 0.0
    for _ in range(20):
        q, v, a = rng.uniform(low, high), rng.normal(size=robot.n), 3.0 * rng.normal(size=robot.n)
        expected = robot.regressor(q, v, a) @ links + stated * a + damping * v + friction * smoothed_sign(v)
        found = TorqueModel(again, []).known_torque(Sample(0.0, q, v, a, np.zeros(robot.n)))
        worst = max(worst, float(np.max(np.abs(found - expected)) / np.max(np.abs(expected))))
    if again.joint_names != robot.joint_names or not worst < _ROUNDING:
        raise ModelFileError(
            f"the URDF that was made gives torques that differ from the model's by a part of {worst:.1g}; {_ROUNDING:g} is "
            "allowed. Report this with the URDF."
        )


def check_model_file(robot: RobotModel, model: ModelFile, path: Path) -> None:
    """Read a model.yaml again and compare it with the model that was written.

    Raises:
        ModelFileError: an effect or a number is not what was written.
    """
    again = ModelFile.read(path)
    for before, after in zip(model.known_effects(robot), again.known_effects(robot), strict=True):
        if before.effect.parameter_names != after.effect.parameter_names or not np.array_equal(before.theta, after.theta):
            raise ModelFileError(f"'{path}' read back holds other parameters of {before.effect.id} than were written.")


def _attached(robot: RobotModel, root: ElementTree.Element, joint: int) -> list[_Attached]:
    """The other links with mass or inertia that a joint carries: some URDFs give a massless frame the inertia of a body."""
    above = {e.find("child").get("link"): e for e in root.findall("joint")}  # type: ignore[union-attr]
    body, out = robot.body_names[joint], []
    for link in root.findall("link"):
        name = str(link.get("name"))
        frame = robot.model.frames[robot.frame_id(name)]
        theta = _inertial(link)
        if name == body or frame.parentJoint != joint + 1 or theta is None:
            continue
        locked, up = False, name
        while up != body:
            locked = locked or above[up].get("type") in _MOVABLE
            up = above[up].find("parent").get("link")  # type: ignore[union-attr,assignment]
        placed = inertial_parameters.move(theta, np.array(frame.placement.rotation), np.array(frame.placement.translation))
        out.append(_Attached(name, locked, placed))
    return out


def _kept(theta: FloatArray, attached: list[_Attached]) -> list[_Attached]:
    """As many of the links as can keep their inertials: all, or those of locked joints, or none."""
    for kept in (attached, [a for a in attached if a.locked]):
        if kept and inertial_parameters.is_physical(theta - np.sum([a.theta for a in kept], axis=0)):
            return kept
    return []


def _inertial(link: ElementTree.Element) -> FloatArray | None:
    """Theta of a link in its own frame, shape (10,); None where it has neither mass nor inertia."""
    inertial = link.find("inertial")
    mass = None if inertial is None else inertial.find("mass")
    if inertial is None or mass is None:
        return None
    origin, tensor = inertial.find("origin"), inertial.find("inertia")
    xyz = [float(x) for x in (origin.get("xyz", "0 0 0") if origin is not None else "0 0 0").split()]
    rpy = [float(x) for x in (origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split()]
    values = [float(tensor.get(a, "0")) if tensor is not None else 0.0 for a in _AXES]
    if not float(mass.get("value", "0")) > 0.0 and not any(values):
        return None
    rotation = rotation_of(rpy)
    inertia = rotation @ inertial_parameters.inertia_matrix(np.array([0.0] * 4 + values)) @ rotation.T
    return inertial_parameters.from_com(float(mass.get("value", "0")), np.array(xyz), inertia)


def _set_inertial(link: ElementTree.Element, theta: FloatArray | None) -> None:
    """Replace a link's inertial; None takes its mass away in plain figures, for simulators that put 1 kg where none is stated."""
    mass, com, inertia = (0.0, np.zeros(3), np.zeros((3, 3))) if theta is None else inertial_parameters.to_com(theta)
    for old in link.findall("inertial"):
        link.remove(old)
    inertial = ElementTree.Element("inertial")
    link.insert(0, inertial)
    ElementTree.SubElement(inertial, "origin", xyz=" ".join(repr(float(x)) for x in com), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    values = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ElementTree.SubElement(inertial, "inertia", {k: repr(float(inertia[i, j])) for k, (i, j) in values.items()})
    ElementTree.indent(inertial, "  ", level=2)
    inertial.tail = "\n    "
