"""A MuJoCo model (MJCF) of a robot with what is known of it: links, rotors, friction, the gain and the delay of its efforts."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from sysid_ros.exceptions import ModelFileError
from sysid_ros.files import write_text
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.torque.known_effect import KnownEffect
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel

STEP = 2e-3
"""Time step that the file states [s]."""
_FRICTION = {"solreffriction": f"{2.0 * STEP} 1", "solimpfriction": "0.99 0.999 0.001 0.5 2"}
"""Dry friction as stiff as the step allows: MuJoCo's own setting lets a joint creep at a few per cent of its level."""
_DELAYS_SINCE = (3, 5)
"""Version of MuJoCo whose actuators and sensors can be late."""
_NEGLIGIBLE = 1e-9
"""Mass [kg] and inertia [kg m^2] of a moving body without any."""
_ROUNDING = 1e-6


def export_mjcf(robot: RobotModel, model: ModelFile, path: Path) -> list[str]:
    """Write the MJCF; what it can't hold or had to change, in words.

    Raises:
        ModelFileError: a link of the model is no body.
    """
    known = TorqueModel(robot, [], model.known_effects(robot))
    for body, theta in zip(robot.body_names, known.links().reshape(-1, 10), strict=True):
        moments = np.linalg.eigvalsh(_body(theta)[2])
        if theta[0] < 0.0 or moments[0] < 0.0 or moments[2] > (1.0 + _ROUNDING) * (moments[0] + moments[1]):
            raise ModelFileError(
                f"the inertials of link '{body}' in {model.source} belong to no body (mass {theta[0]:.3g} kg), and simulators "
                "take bodies only. Identify with physical consistency."
            )
    write_text(path, mjcf(known))
    lost = dict.fromkeys(k.effect.id for k in known.known if np.any(k.theta) and not _held(k))
    return [f"An MJCF can't hold {', '.join(lost)}; model.yaml does."] if lost else []


def mjcf(known: TorqueModel) -> str:
    """The MJCF of a robot with all that is known of its torques.

    A body a joint, in the frame of that joint, with all that is fixed to it; the robot's other links are sites. ``armature``,
    ``damping`` and ``frictionloss`` are those of the model, which MuJoCo adds on the motor side of no gear. The control of a
    joint's motor is its effort as published: with a gain of the measurement, the motor's ``gear`` is the inverse. Efforts that
    are published late are a sensor's ``delay``; efforts that come before the torque acts, as commands do, the actuator's.
    """
    robot = known.robot
    root = ElementTree.Element("mujoco", model=robot.name)
    root.append(ElementTree.Comment(" Rotors, friction, gains and delays as found; without shapes, end stops and contacts. "))
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    ElementTree.SubElement(root, "option", timestep=repr(STEP), integrator="implicitfast", gravity=_words(robot.gravity))
    ElementTree.SubElement(ElementTree.SubElement(root, "default"), "joint", _FRICTION)
    _bodies(ElementTree.SubElement(root, "worldbody"), known)
    _channels(root, known)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _bodies(world: ElementTree.Element, known: TorqueModel) -> None:
    robot, model = known.robot, known.robot.model
    axes = {str(e.get("name")): e.find("axis") for e in ElementTree.fromstring(robot.urdf).findall("joint")}
    armature, damping, friction = (np.maximum(x, 0.0) for x in (known.armature(), known.damping(), known.dry_friction()))
    bodies = [world]
    for j, (name, theta) in enumerate(zip(robot.joint_names, known.links().reshape(-1, 10), strict=True)):
        placed = model.jointPlacements[j + 1]
        body = ElementTree.SubElement(bodies[model.parents[j + 1]], "body", {"name": robot.body_names[j], **_placement(placed)})
        bodies.append(body)
        _inertial(body, theta)
        axis = axes[name]
        dynamics = {
            word: repr(float(values[j]))
            for word, values in (("armature", armature), ("damping", damping), ("frictionloss", friction))
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
    gain = np.prod([k.effect.as_gain(k.theta) for k in known.known], axis=0, initial=1.0) * np.ones(robot.n)
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


def _held(known: KnownEffect) -> bool:
    """Whether the file holds all of an effect."""
    effect, theta = known.effect, known.theta
    beside = np.any(effect.as_armature(theta)) or effect.as_delay(theta) or np.any(effect.as_gain(theta) != 1.0)
    return effect.in_urdf or bool(beside)


def _takes_delays() -> bool:
    """Whether the installed MuJoCo knows delays; where none is installed a newer one will read the file."""
    try:
        return tuple(int(x) for x in metadata.version("mujoco").split(".")[:2]) >= _DELAYS_SINCE
    except metadata.PackageNotFoundError:
        return True


def _body(theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre of mass and inertia about it; next to nothing in place of nothing, which MuJoCo does not take."""
    mass, com, inertia = inertial_parameters.to_com(theta)
    if not mass > _NEGLIGIBLE:
        return mass if mass < 0.0 else _NEGLIGIBLE, np.zeros(3), _NEGLIGIBLE * np.eye(3)
    return mass, com, inertia + _NEGLIGIBLE * np.eye(3) if abs(np.linalg.eigvalsh(inertia)[0]) < _NEGLIGIBLE else inertia


def _inertial(body: ElementTree.Element, theta: FloatArray) -> None:
    mass, com, inertia = _body(theta)
    tensor = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    ElementTree.SubElement(body, "inertial", pos=_words(com), mass=repr(mass), fullinertia=_words(tensor))


def _placement(at: Any) -> dict[str, str]:
    rotation = np.array(at.rotation)
    return {"pos": _words(at.translation), "xyaxes": _words([*rotation[:, 0], *rotation[:, 1]])}


def _words(values: FloatArray | list[float]) -> str:
    return " ".join(repr(float(x)) for x in values)
