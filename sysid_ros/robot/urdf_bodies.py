"""The bodies that a URDF fixes to the links that its joints move, and how far the arm reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy import special

from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, eq=False)
class FixedBody:
    """A link of the URDF that is fixed to a moving one, with all that is fixed to it.

    Attributes:
        name: of the link. links: that it consists of, without those that weigh nothing.
        theta: its ten inertial parameters in the frame of the joint that moves it, shape (10,).
    """

    name: str
    links: tuple[str, ...]
    theta: FloatArray


def fixed_bodies(robot: RobotModel, joint: int) -> list[FixedBody]:
    """What the URDF fixes to the link that a joint (index) moves, also by joints that are locked; a body of one link with others
    on it stands for all of them, and each of them for itself."""
    frames = list(robot.model.frames)
    names = {f.parentFrame: f.name for f in frames if f.type == pin.FrameType.BODY}
    fixed = [i for i, f in enumerate(frames) if f.type == pin.FrameType.FIXED_JOINT and f.parentJoint == joint + 1]
    above = {i: _above(frames, i) for i in fixed}
    bodies: dict[tuple[int, ...], FixedBody] = {}
    for root in fixed:
        parts = [i for i in fixed if (i == root or root in above[i]) and frames[i].inertia.mass > 0.0]
        if parts:
            theta = np.sum([_in_joint(frames[i]) for i in parts], axis=0)
            bodies[tuple(parts)] = FixedBody(names[parts[0]], tuple(names[i] for i in parts), theta)
    return list(bodies.values())


def matching(robot: RobotModel, joint: int, first: FloatArray, std: FloatArray) -> list[FixedBody]:
    """The bodies fixed to a link that a body's mass and first moment do not refute at 95 %, the likeliest first.

    Args:
        joint: that moves the link. first, std: mass [kg] and first moment in the joint's frame [kg m], shape (4,).
    """
    far = {b: float(np.sum(((b.theta[:4] - first) / np.maximum(std, 1e-9)) ** 2)) for b in fixed_bodies(robot, joint)}
    near: list[FixedBody] = sorted((b for b in far if far[b] < special.chdtri(4, 0.05)), key=far.__getitem__)
    return near


def within_reach(robot: RobotModel, first: FloatArray, std: FloatArray) -> bool:
    """True where a body has a mass and its centre of mass is no farther off than the robot is long, within twice the standard
    deviations.

    Args:
        first, std: mass [kg] and first moment [kg m], then whatever, shape (4,) or more.
    """
    heaviest = float(first[0] + 2.0 * std[0])
    nearest = float(np.linalg.norm(np.maximum(np.abs(first[1:4]) - 2.0 * std[1:4], 0.0)))
    return heaviest > 0.0 and nearest <= heaviest * reach(robot)


def beyond_joint(robot: RobotModel, frame: str) -> float:
    """How far a frame is from the joint that moves it [m].

    Raises:
        RobotModelError: there is no such frame.
    """
    return float(np.linalg.norm(robot.model.frames[robot.frame_id(frame)].placement.translation))


def reach(robot: RobotModel) -> float:
    """How far from any joint a part of the robot can be at most [m]: all distances between its joints, with what slides, and that
    of the farthest frame or centre of mass beyond one."""
    model = robot.model
    between = [float(np.linalg.norm(model.jointPlacements[j].translation)) for j in range(2, model.njoints)]
    slides = np.where(robot.is_prismatic, np.maximum(np.abs(robot.position_lower), np.abs(robot.position_upper)), 0.0)
    beyond = max(float(np.linalg.norm(f.placement.translation)) for f in model.frames)
    own = max(float(np.linalg.norm(i.lever)) for i in model.inertias)
    return sum(between) + float(np.sum(slides)) + max(beyond, own)


def as_links(robot: RobotModel, frame: str, theta: FloatArray) -> FloatArray:
    """What a body fixed to a frame adds to the link inertials, shape (10 n,).

    Args:
        theta: its ten parameters about the frame's origin, shape (10,).

    Raises:
        RobotModelError: there is no such frame.
    """
    of = robot.model.frames[robot.frame_id(frame)]
    out = np.zeros((robot.n, 10))
    if of.parentJoint:  # else it is fixed to the base, and no joint carries it
        out[of.parentJoint - 1] = inertial_parameters.move(
            theta, np.array(of.placement.rotation), np.array(of.placement.translation)
        )
    return out.ravel()


def _above(frames: list[pin.Frame], index: int) -> set[int]:
    """The frames between one and the root."""
    out: set[int] = set()
    while (index := frames[index].parentFrame) not in out:
        out.add(index)
    return out


def _in_joint(frame: pin.Frame) -> FloatArray:
    placement = frame.placement
    theta = np.array(frame.inertia.toDynamicParameters())
    return inertial_parameters.move(theta, np.array(placement.rotation), np.array(placement.translation))
