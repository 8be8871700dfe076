"""From the order of a message to the order of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid_ros.exceptions import SettingsError
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray


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
    """``effort_scale`` times ``effort_sign`` in the robot's joint order, shape (n,).

    They are given in the order of ``settings.joint_names`` where that names the robot's joints, else in the robot's.

    Raises:
        SettingsError: another length than the robot has joints, or a sign that is not +1 or -1.
    """
    order = settings.joint_names if set(settings.joint_names) == set(robot.joint_names) else robot.joint_names
    factor = np.ones(robot.n)
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
