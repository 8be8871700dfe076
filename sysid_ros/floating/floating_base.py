"""FloatingBase: a legged robot as a tree of joints whose first six are those of its free trunk."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import numpy as np

from sysid_ros.exceptions import RobotModelError
from sysid_ros.floating.contact_kinematics import ContactKinematics
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.trunk_channels import TrunkSetup

LEAST_JOINTS = 3
"""Joints of a leg from whose torques the force on its foot is known."""

_FOOT = 0.009
"""Radius of a usual foot over the cube root of the robot's mass [m/kg^(1/3)]; quadrupeds from 2 to 90 kg have 0.005 to 0.013, and
frames where the ground is touched 0."""

_AXES = ("x", "y", "z")

_SPEED = "2"
"""Of the trunk where a motion of the whole robot is made up [m/s], [rad/s]."""


class FloatingBase:
    """A legged robot whose trunk nothing holds.

    The trunk hangs on three prismatic and three revolute joints without mass, all of them at zero, so that the axes of the trunk
    are those of the base. Their velocities and accelerations are what the IMU tells: angular velocity ``w``, specific force ``s``
    of the trunk's origin (acceleration minus gravity; the model itself has none) and angular acceleration. No velocity and no
    place of the trunk is needed, because the equations of motion are the same for every observer in uniform motion::

        rnea(q, v, a) = [0; tau] + sum_feet J_i(q)' f_i,       q = [0; q_legs],  v = [0; w; v_legs],  a = [s; dw'; a_legs]

    where ``dw' = dw - [w_y w_z, -w_x w_z, w_x w_y]`` is the acceleration of the three turns at zero.

    Args:
        legs: the robot with its trunk held; its joints are those that are measured.
        contact_frames: links that may touch the ground; empty: the outermost link of every leg, in the order of the URDF.
        foot_radius: of all feet [m]; 0: that of the sphere that the URDF gives each.

    Attributes:
        robot: the model with n = 6 + number of leg joints; the first six rows are force [N] and moment [N m] on the trunk.
        trunk: name of the trunk's link. trunk_frames: links that are fixed to it, itself among them.
        contacts: kinematics of the feet. mass: of the whole robot [kg].
        foot_radius: of each foot, guessed where nothing tells it, shape (k,) [m]. radius_told: where something does, shape (k,).
        radius_std: standard deviation of a guess [m].
        setup: what was identified of IMU and feet, which the input gate and the contacts go by. setup_std: how well, None where
            nothing was.

    Raises:
        RobotModelError: a contact frame is no link of the URDF or no leg carries it.
    """

    def __init__(self, legs: RobotModel, contact_frames: Sequence[str] = (), foot_radius: float = 0.0) -> None:
        self.legs = legs
        root = ElementTree.fromstring(legs.urdf)
        self.trunk = _root_link(root)
        self.robot = RobotModel.from_urdf(
            _hung(root, self.trunk), [*_free_joints(self.trunk), *legs.joint_names], (0.0, 0.0, 0.0)
        )
        frames = tuple(contact_frames) or self._outermost(root)
        missing = sorted(set(frames) - set(legs.frame_names))
        if missing:
            raise RobotModelError(
                f"contact frames {', '.join(missing)} are no links of the URDF '{legs.name}'. It has "
                f"{', '.join(legs.frame_names)}. Correct contact_frames."
            )
        self.foot_radius, centres = _spheres(root, frames)
        if foot_radius > 0.0:
            self.foot_radius = np.full(len(frames), foot_radius)
        self.radius_told = self.foot_radius > 0.0
        self.contacts = ContactKinematics(self.robot, frames, centres)
        for frame, joints in zip(frames, self.contacts.joints_above, strict=True):
            if joints < FREE + LEAST_JOINTS:
                raise RobotModelError(
                    f"contact frame {frame} hangs on {max(joints - FREE, 0)} joints; the force on a foot is known from the "
                    f"torques of at least {LEAST_JOINTS}. Name the feet in contact_frames."
                )
        self.mass = float(self.robot.pi[::10].sum())
        self.radius_std = _FOOT * self.mass ** (1.0 / 3.0)
        self.foot_radius = np.where(self.radius_told, self.foot_radius, self.radius_std)
        self.setup = TrunkSetup()
        self.setup_std: TrunkSetup | None = None
        above = ContactKinematics(self.robot, legs.frame_names).joints_above
        self.trunk_frames: tuple[str, ...] = tuple(name for name, n in zip(legs.frame_names, above, strict=True) if n == FREE)

    @property
    def contact_frames(self) -> tuple[str, ...]:
        """Names of the feet, k of them."""
        return self.contacts.frames

    def set_up(self, setup: TrunkSetup, std: TrunkSetup) -> None:
        """Take in what was identified of IMU and feet, with standard deviations in the same form."""
        self.setup, self.setup_std = setup, std
        self.foot_radius = self.foot_radius + np.array([setup.radius.get(name, 0.0) for name in self.contact_frames])
        self.radius_told = self.radius_told | np.array([name in setup.radius for name in self.contact_frames])

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know, a sentence each."""
        points = [name for name, told in zip(self.contact_frames, self.radius_told, strict=True) if not told]
        if not points:
            return ()
        return (
            f"The URDF gives {', '.join(points)} no sphere in <collision>: how far below their origin they touch the ground is "
            f"guessed, {1e3 * self.radius_std:.0f} mm to within as much, and estimated beside the payload. Set foot_radius.",
        )

    def state(
        self, q: FloatArray, v: FloatArray, a: FloatArray, omega: FloatArray, force: FloatArray, omega_dot: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Positions, velocities and accelerations of all n joints.

        Args:
            q, v, a: of the legs. omega: of the trunk [rad/s]. force: specific force of the trunk's origin [m/s^2].
            omega_dot: angular acceleration [rad/s^2]; the three in the trunk's axes, shape (3,).
        """
        x, y, z = omega
        product = np.array([y * z, -x * z, x * y])
        zero = np.zeros(3)
        return (
            np.concatenate((zero, zero, q)),
            np.concatenate((zero, omega, v)),
            np.concatenate((force, omega_dot - product, a)),
        )

    def unhung(self, urdf: str) -> str:
        """A URDF of the robot on its floating base, as ``robot.urdf``, with the trunk as its root again."""
        root = ElementTree.fromstring(urdf)
        joints = _free_joints(self.trunk)
        above = {f"{self.trunk} ground", *(f"{name} link" for name in joints)}
        for kind, names in (("joint", set(joints)), ("link", above)):
            for element in root.findall(kind):
                if element.get("name") in names:
                    root.remove(element)
        return ElementTree.tostring(root, encoding="unicode")

    def _outermost(self, root: ElementTree.Element) -> tuple[str, ...]:
        """The link of every leg that is farthest from the leg's last joint, in the order of the URDF."""
        ends = ContactKinematics(self.robot, ContactKinematics.ends(self.robot))
        names = {name for name, joints in zip(ends.frames, ends.joints_above, strict=True) if joints >= FREE + LEAST_JOINTS}
        return tuple(str(link.get("name")) for link in root.findall("link") if link.get("name") in names)


def floating_base_of(robot: RobotModel, settings: OnlineSettings) -> FloatingBase | None:
    """The robot on a floating base where the setting ``base`` says so or, for ``auto``, its URDF looks so; else None.

    Raises:
        RobotModelError: ``contact_frames`` does not fit the robot.
    """
    if settings.base == "fixed" or (settings.base == "auto" and not (settings.contact_frames or is_legged(robot))):
        return None
    return FloatingBase(robot, settings.contact_frames, settings.foot_radius)


def is_legged(robot: RobotModel) -> bool:
    """True for a URDF whose root has mass and carries at least three legs of three movable joints or more: a robot that stands on
    the ground by itself."""
    legs = [length for length in ContactKinematics.leg_lengths(robot) if length >= LEAST_JOINTS]
    return len(legs) >= 3 and ContactKinematics.mass_of_base(robot) > 0.0


def _free_joints(trunk: str) -> list[str]:
    return [f"{trunk} {kind} {axis}" for kind in ("force", "moment") for axis in _AXES]


def _root_link(root: ElementTree.Element) -> str:
    children = {str(link.get("link")) for link in root.findall("joint/child")}
    roots = [str(link.get("name")) for link in root.findall("link") if link.get("name") not in children]
    if len(roots) != 1:
        raise RobotModelError(f"the URDF has {len(roots)} root links; it must have one, the trunk. Check it with check_urdf.")
    return roots[0]


def _hung(root: ElementTree.Element, trunk: str) -> str:
    """The URDF with the trunk on six more joints."""
    parent = f"{trunk} ground"
    ElementTree.SubElement(root, "link", name=parent)
    for name, axis, kind in zip(_free_joints(trunk), _AXES * 2, ("prismatic",) * 3 + ("revolute",) * 3, strict=True):
        last = name == _free_joints(trunk)[-1]
        child = trunk if last else f"{name} link"
        if not last:
            ElementTree.SubElement(root, "link", name=child)
        joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        ElementTree.SubElement(joint, "axis", xyz=" ".join("1" if axis == other else "0" for other in _AXES))
        ElementTree.SubElement(joint, "limit", lower="-1e6", upper="1e6", effort="0", velocity=_SPEED)
        parent = child
    return ElementTree.tostring(root, encoding="unicode")


def _spheres(root: ElementTree.Element, frames: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Radius, shape (k,), and centre in the link's axes, shape (k, 3) [m], of the sphere that each link collides with; 0
    without."""
    radii, centres = np.zeros(len(frames)), np.zeros((len(frames), 3))
    for i, frame in enumerate(frames):
        for collision in root.findall(f"link[@name='{frame}']/collision"):
            sphere, origin = collision.find("geometry/sphere"), collision.find("origin")
            if sphere is None:
                continue
            radii[i] = float(str(sphere.get("radius")))
            if origin is not None:
                centres[i] = [float(x) for x in origin.get("xyz", "0 0 0").split()]
            break
    return radii, centres
