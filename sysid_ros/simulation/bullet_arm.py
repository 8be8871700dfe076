"""An arm in PyBullet: a URDF of a model's moving bodies, with rotors and damping in the torque that the links get."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np

from sysid_ros.exceptions import RobotModelError
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.arm import ArmWorld
from sysid_ros.simulation.held_motion import STEP
from sysid_ros.torque.torque_model import TorqueModel

_AXES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
_ROUNDING = 1e-6


class BulletArm:
    """As :class:`sysid_ros.simulation.held_motion.Arm`. PyBullet has no rotors, and its damping is explicit: with its own M and
    C v + g the acceleration a of the step is solved for, and the links get ``tau - J a - d (v + h a)``.

    Raises:
        RobotModelError: a link's inertia is that of no body.
    """

    def __init__(self, known: TorqueModel) -> None:
        robot = known.robot
        self._world = ArmWorld(_urdf(known), robot.body_names[-1], tuple(robot.gravity.tolist()), STEP)
        self._there = [self._world.joint_names.index(name) for name in robot.joint_names]
        self._back = np.argsort(self._there)
        self._rotor = np.maximum(known.armature(), 0.0)[self._back]
        self._read()

    def _read(self) -> None:
        self.q, self.v = self._world.q[self._there], self._world.v[self._there]

    def reset(self, q: FloatArray, v: FloatArray) -> None:
        """Put the joints into a state, shape (n,) each."""
        self._world.reset(q[self._back], v[self._back])
        self._read()

    def step(self, tau: FloatArray, damping: FloatArray) -> None:
        """One step under joint torques tau [N m] and damping [N m s/rad], shape (n,) each."""
        world, d, tau = self._world, damping[self._back], tau[self._back]
        left = tau - d * world.v - world.inverse_dynamics(world.q, world.v, np.zeros(len(tau)))
        a = np.linalg.solve(world.mass_matrix(world.q) + np.diag(self._rotor + STEP * d), left)
        world.step(tau - self._rotor * a - d * (world.v + STEP * a))
        self._read()

    def close(self) -> None:
        """Free the world."""
        self._world.close()


make = BulletArm


def _urdf(known: TorqueModel) -> str:
    """The moving bodies with all that is fixed to them, a link each in the frame of its joint; no shapes, no end stops."""
    robot = known.robot
    axes = {str(e.get("name")): e.find("axis") for e in ElementTree.fromstring(robot.urdf).findall("joint")}
    root = ElementTree.Element("robot", name="arm")
    names = ["base_of_the_arm", *robot.body_names]
    _inertial(ElementTree.SubElement(root, "link", name=names[0]), np.zeros(10))
    for j, theta in enumerate(known.links().reshape(-1, 10), start=1):
        _inertial(ElementTree.SubElement(root, "link", name=names[j]), theta)
        name, placed = robot.joint_names[j - 1], robot.model.jointPlacements[j]
        kind = "prismatic" if robot.is_prismatic[j - 1] else "continuous"
        joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
        ElementTree.SubElement(joint, "parent", link=names[robot.model.parents[j]])
        ElementTree.SubElement(joint, "child", link=names[j])
        rpy = _words(_rpy(np.array(placed.rotation)))
        ElementTree.SubElement(joint, "origin", xyz=_words(placed.translation), rpy=rpy)
        ElementTree.SubElement(joint, "limit", lower="1", upper="-1", effort="0", velocity="0")
        axis = axes[name]
        ElementTree.SubElement(joint, "axis", xyz="1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
    return ElementTree.tostring(root, encoding="unicode")


def _inertial(link: ElementTree.Element, theta: FloatArray) -> None:
    mass, com, inertia = inertial_parameters.to_com(theta) if theta[0] > 0.0 else (0.0, np.zeros(3), np.zeros((3, 3)))
    moments = np.linalg.eigvalsh(inertia).tolist()
    if moments[0] < 0.0 or moments[2] > (1.0 + _ROUNDING) * (moments[0] + moments[1]):
        raise RobotModelError(
            f"the principal moments of inertia of link '{link.get('name')}', {_words(moments)} kg m^2, are those of no body, and "
            "PyBullet takes bodies only. Correct its inertia in the URDF, or take --simulator mujoco."
        )
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_words(com))
    ElementTree.SubElement(inertial, "mass", value=repr(mass))
    ElementTree.SubElement(inertial, "inertia", {k: repr(float(inertia[where])) for k, where in _AXES.items()})


def _rpy(rotation: FloatArray) -> list[float]:
    """Roll, pitch and yaw of a URDF, at the poles of the pitch too."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    across = np.array([-np.sin(yaw), np.cos(yaw), 0.0]) @ rotation
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    return [float(np.arctan2(-across[2], across[1])), float(pitch), float(yaw)]


def _words(values: FloatArray | list[float]) -> str:
    return " ".join(repr(float(x)) for x in values)
