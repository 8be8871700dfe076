"""From a message to the model: the order of its joints, the factors of its efforts, and how large a value can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import SettingsError
from sysid_ros.input_gate import kernel
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.effort_presets import preset
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_MARGIN = 10.0
"""URDFs state torque and velocity limits that are wrong by factors; garbage is wrong by powers of ten."""

_POSTURES = 64


@dataclass(frozen=True, slots=True)
class Mapping:
    """How messages with certain names are read.

    Attributes:
        index: where in the message each joint of the model stands, shape (n,).
        size: m, the number of names.
        raw: position, velocity, effort of the last message, shape (3, m).
        position, velocity, effort: the rows of ``raw``, to fill it.
    """

    index: NDArray[np.intp]
    size: int
    raw: FloatArray
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray

    @classmethod
    def of(cls, names: Sequence[str], joints: Sequence[str]) -> Mapping:
        """The mapping for messages with these names, which hold all the joints."""
        raw = np.full((3, len(names)), np.nan)
        return cls(np.array([names.index(joint) for joint in joints], dtype=np.intp), len(names), raw, raw[0], raw[1], raw[2])


def effort_factor(robot: RobotModel, settings: OnlineSettings) -> FloatArray:
    """``effort_scale``, or that of ``effort_preset``, times ``effort_sign`` in the robot's joint order, shape (n,).

    Numbers are given in the order of ``settings.joint_names`` where that names the robot's joints, else in the robot's.

    Raises:
        SettingsError: another length than the robot has joints, a sign that is not +1 or -1, or a preset of another arm.
    """
    order = settings.joint_names if set(settings.joint_names) == set(robot.joint_names) else robot.joint_names
    factor = _of_preset(robot, settings) if settings.effort_preset else np.ones(robot.n)
    for name, values in (("effort_scale", settings.effort_scale), ("effort_sign", settings.effort_sign)):
        if values and len(values) != robot.n:
            raise SettingsError(
                f"{name} has {len(values)} numbers; the robot has {robot.n} joints. "
                f"Give one number for each of {', '.join(order)}, in this order."
            )
        if name == "effort_sign" and any(abs(value) != 1.0 for value in values):
            raise SettingsError(f"effort_sign is {list(values)}; each must be +1 or -1.")
        if values:
            by_name = dict(zip(order, values, strict=True))
            factor *= [by_name[joint] for joint in robot.joint_names]
    return factor


def _of_preset(robot: RobotModel, settings: OnlineSettings) -> FloatArray:
    one = preset(settings.effort_preset)
    if settings.effort_scale:
        raise SettingsError(f"effort_preset is {settings.effort_preset!r} and effort_scale is given too. Give one of them.")
    factor = one.of(robot.joint_names)
    if factor is None:
        raise SettingsError(
            f"effort_preset is {settings.effort_preset!r}, for joints {', '.join(one.joints)}; the robot has "
            f"{', '.join(robot.joint_names)}. Set effort_scale, a number for each."
        )
    return factor


def plausible_limits(robot: RobotModel) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Largest |q|, |v| and |tau| that are believed, each shape (n,); infinite where the URDF gives nothing to go by.

    The limits are ten times those of the URDF. A torque limit below what holds the arm's own weight is not believed.
    """
    reach = np.maximum(np.abs(robot.position_lower), np.abs(robot.position_upper))
    position = _MARGIN * np.where(robot.is_prismatic, np.maximum(reach, 0.1), np.maximum(reach, np.pi))
    own_weight = largest_gravity_torque(robot)
    effort = _MARGIN * np.maximum(robot.effort_limit, np.maximum(own_weight, 0.1 * own_weight.max()))
    return position, _MARGIN * robot.velocity_limit, effort


def limit_table(robot: RobotModel, settings: OnlineSettings) -> FloatArray:
    """What :func:`.kernel.check` holds each joint's values against, shape (8, n)."""
    limits = np.empty((8, robot.n))
    limits[kernel.MAX_POSITION], limits[kernel.MAX_VELOCITY], limits[kernel.MAX_EFFORT] = plausible_limits(robot)
    limits[kernel.MAX_JUMP_RATE] = limits[kernel.MAX_VELOCITY]
    limits[kernel.JUMP_FLOOR] = np.where(robot.is_prismatic, 0.05, 0.1)
    limits[kernel.PERIODIC] = ~robot.is_prismatic
    limits[kernel.MOVED] = 0.01
    limits[kernel.SCALE] = effort_factor(robot, settings)
    return limits


def largest_gravity_torque(robot: RobotModel) -> FloatArray:
    """Largest |gravity torque| of each joint over random postures, shape (n,) [N m]."""
    rng = np.random.default_rng(0)
    bound = np.where(robot.is_prismatic, 1.0, np.pi)
    lower = np.maximum(robot.position_lower, -bound)
    upper = np.maximum(np.minimum(robot.position_upper, bound), lower)
    postures = rng.uniform(lower, upper, size=(_POSTURES, robot.n))
    return np.asarray(np.max(np.abs([robot.gravity_torque(q) for q in postures]), axis=0))
