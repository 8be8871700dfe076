"""Arms of different make: URDFs without meshes and without ``<dynamics>``, so that what they say is only their links."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from sysid_ros.robot.robot_model import RobotModel

# path below share/example-robot-data/robots, or below pybullet_data; joints that are no joints of the arm
_FILES = {
    "panda": ("panda_description/urdf/panda.urdf", ("finger",)),
    "iiwa": ("kuka_iiwa/model.urdf", ()),
    "ur5": ("ur_description/urdf/ur5_joint_limited_robot.urdf", ()),
    "ur10": ("ur_description/urdf/ur10_joint_limited_robot.urdf", ()),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", ()),
}
ARMS = tuple(_FILES)
_MORE = {
    "z1": ("z1_description/urdf/z1.urdf", ("Gripper",)),
    "kinova": ("kinova_description/robots/kinova.urdf", ()),
    "xarm6": ("xarm/xarm6_robot.urdf", ()),
    "baxter": ("baxter_description/urdf/baxter.urdf", ("head", "right", "gripper")),
    "tiago_pro": ("tiago_pro_description/robots/tiago_pro.urdf", ("wheel", "torso", "right", "head", "gripper")),
}
TEN_ARMS = (*_FILES, *_MORE)
# what the makers state [N m], where a URDF has one number for all joints
_RATED = {"iiwa": (320.0, 320.0, 176.0, 176.0, 110.0, 40.0, 40.0)}


@dataclass(frozen=True)
class Arm:
    """URDF text and the joints that its messages name."""

    urdf: str
    joint_names: tuple[str, ...]

    def model(self) -> RobotModel:
        return RobotModel.from_urdf(self.urdf, self.joint_names)


def rated_effort(name: str) -> np.ndarray:
    """Torque that each joint of an arm is built for, shape (n,) [N m]."""
    return np.array(_RATED[name]) if name in _RATED else arm(name).model().effort_limit


def _file(relative: str) -> Path:
    import pinocchio
    import pybullet_data

    below = [Path(pybullet_data.getDataPath())]
    below += [parent / "share/example-robot-data/robots" for parent in Path(pinocchio.__file__).parents]
    found = next((folder / relative for folder in below if (folder / relative).is_file()), None)
    if found is None:
        raise FileNotFoundError(f"{relative} is not there. pip install example-robot-data")
    return found


def all_there() -> bool:
    """True where the URDFs of all arms are installed."""
    try:
        return all(_file(relative) for relative, _ in (_FILES | _MORE).values())
    except FileNotFoundError:
        return False


@cache
def arm(name: str) -> Arm:
    """An arm of ``TEN_ARMS``."""
    relative, foreign = (_FILES | _MORE)[name]
    root = ElementTree.parse(_file(relative)).getroot()
    for parent, tag in (
        (p, t) for p in root.iter() for t in ("visual", "collision", "dynamics", "transmission", "gazebo", "material")
    ):
        for element in parent.findall(tag):
            parent.remove(element)
    text = ElementTree.tostring(root, encoding="unicode")
    names = RobotModel.from_urdf(text).joint_names
    return Arm(text, tuple(j for j in names if not any(word in j for word in foreign)))


def with_dynamics(base: Arm, damping: np.ndarray, friction: np.ndarray) -> Arm:
    """The arm whose URDF declares viscous [N m s/rad] and Coulomb [N m] friction, shape (n,)."""
    root = ElementTree.fromstring(base.urdf)
    values = dict(zip(base.joint_names, zip(damping, friction, strict=True), strict=True))
    for joint in root.findall("joint"):
        if (name := joint.get("name")) in values:
            b, fc = values[name]
            ElementTree.SubElement(joint, "dynamics", damping=repr(float(b)), friction=repr(float(fc)))
    return Arm(ElementTree.tostring(root, encoding="unicode"), base.joint_names)
