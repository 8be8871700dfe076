"""A MuJoCo model (MJCF) of a robot with what is known of it: links, rotors, friction, the gain and the delay of its efforts."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.files import write_text
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.exported import Holds, JointParameters, comment, known_of, not_held, require_bodies, words
from sysid_ros.torque.exported import body as body_of
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel

STEP = 2e-3
"""Time step that the file states [s]."""
_FRICTION = {"solreffriction": f"{2.0 * STEP} 1", "solimpfriction": "0.99 0.999 0.001 0.5 2"}
"""Dry friction as stiff as the step allows: MuJoCo's own setting lets a joint creep at a few per cent of its level."""
_DELAYS_SINCE = (3, 5)
"""Version of MuJoCo whose actuators and sensors can be late."""


def export_mjcf(robot: RobotModel, model: ModelFile, path: Path) -> list[str]:
    """Write the MJCF; what it can't hold or had to change, in words.

    Raises:
        ModelFileError: a link of the model is no body.
    """
    known = known_of(robot, model)
    require_bodies(known, model.source)
    notes = not_held(known, "An MJCF", ~Holds(0))
    write_text(path, mjcf(known, notes))
    return notes


def mjcf(known: TorqueModel, notes: Sequence[str] = ()) -> str:
    """The MJCF of a robot with all that is known of its torques.

    A body a joint, in the frame of that joint, with all that is fixed to it; the robot's other links are sites. ``armature``,
    ``damping`` and ``frictionloss`` are those of the model, which MuJoCo adds on the motor side of no gear. The control of a
    joint's motor is its effort as published: with a gain of the measurement, the motor's ``gear`` is the inverse. Efforts that
    are published late are a sensor's ``delay``; efforts that come before the torque acts, as commands do, the actuator's.
    Gravity is that in the axes of the base as it stands.

    Args:
        notes: sentences for the comment at the top, about what the file does not hold.
    """
    robot = known.robot
    root = ElementTree.Element("mujoco", model=robot.name)
    about = "Rotors, friction, gains and delays as found; without shapes, end stops and contacts."
    root.append(ElementTree.Comment(comment([about, *notes])))
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    gravity = words(robot.gravity + sum((k.effect.as_gravity(k.theta) for k in known.known), np.zeros(3)))
    ElementTree.SubElement(root, "option", timestep=repr(STEP), integrator="implicitfast", gravity=gravity)
    ElementTree.SubElement(ElementTree.SubElement(root, "default"), "joint", _FRICTION)
    _bodies(ElementTree.SubElement(root, "worldbody"), known)
    _channels(root, known)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _bodies(world: ElementTree.Element, known: TorqueModel) -> None:
    robot, model = known.robot, known.robot.model
    axes = {str(e.get("name")): e.find("axis") for e in ElementTree.fromstring(robot.urdf).findall("joint")}
    has = JointParameters.of(known)
    bodies = [world]
    for j, (name, theta) in enumerate(zip(robot.joint_names, known.links().reshape(-1, 10), strict=True)):
        placed = model.jointPlacements[j + 1]
        body = ElementTree.SubElement(bodies[model.parents[j + 1]], "body", {"name": robot.body_names[j], **_placement(placed)})
        bodies.append(body)
        _inertial(body, theta)
        axis = axes[name]
        dynamics = {
            word: repr(float(values[j]))
            for word, values in (("armature", has.armature), ("damping", has.damping), ("frictionloss", has.friction))
            if values[j] > 0.0
        }
        kind, along = "slide" if robot.is_prismatic[j] else "hinge", "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
        ElementTree.SubElement(body, "joint", {"name": name, "type": kind, "axis": along, **dynamics})
    for frame in robot.frame_names:
        at = model.frames[robot.frame_id(frame)]
        if frame not in robot.body_names:
            ElementTree.SubElement(bodies[at.parentJoint], "site", {"name": frame, "size": "0.005", **_placement(at.placement)})


def _channels(root: ElementTree.Element, known: TorqueModel) -> None:
    """Motors and effort sensors of the joints, with the gain and the delay of what is published."""
    robot = known.robot
    gain = JointParameters.of(known).torque_gain
    late = sum(k.effect.as_delay(k.theta) for k in known.known)
    if late:
        custom = ElementTree.SubElement(root, "custom")
        custom.append(ElementTree.Comment(" By how much efforts are published late; below zero: early, as commands are. [s] "))
        ElementTree.SubElement(custom, "numeric", name="effort_delay", data=repr(late))
    delay = {"delay": repr(abs(late)), "nsample": str(math.ceil(abs(late) / STEP) + 1)} if late and _takes_delays() else {}
    motors, sensors = (ElementTree.SubElement(root, tag) for tag in ("actuator", "sensor"))
    for j, name in enumerate(robot.joint_names):
        gear = repr(1.0 / float(gain[j])) if gain[j] else "1"
        motor, sensor = {"name": name, "joint": name, "gear": gear}, {"name": f"{name}_effort", "actuator": name}
        ElementTree.SubElement(motors, "motor", motor | (delay if late < 0.0 else {}))
        ElementTree.SubElement(sensors, "actuatorfrc", sensor | (delay if late > 0.0 else {}))


def _takes_delays() -> bool:
    """Whether the installed MuJoCo knows delays; where none is installed a newer one will read the file."""
    try:
        return tuple(int(x) for x in metadata.version("mujoco").split(".")[:2]) >= _DELAYS_SINCE
    except metadata.PackageNotFoundError:
        return True


def _inertial(body: ElementTree.Element, theta: FloatArray) -> None:
    mass, com, inertia = body_of(theta)
    tensor = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    ElementTree.SubElement(body, "inertial", pos=words(com), mass=repr(mass), fullinertia=words(tensor))


def _placement(at: Any) -> dict[str, str]:
    rotation = np.array(at.rotation)
    return {"pos": words(at.translation), "xyaxes": words([*rotation[:, 0], *rotation[:, 1]])}
