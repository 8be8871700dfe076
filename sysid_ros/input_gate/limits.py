"""How large a value can be before it can't be a measurement."""

from __future__ import annotations

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_MARGIN = 10.0
"""URDFs state torque and velocity limits that are wrong by factors; garbage is wrong by powers of ten."""

_POSTURES = 64


def plausible_limits(robot: RobotModel) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Largest |q|, |v| and |tau| that are believed, each shape (n,); infinite where the URDF gives nothing to go by.

    The limits are ten times those of the URDF. A torque limit below what holds the arm's own weight is not believed.
    """
    reach = np.maximum(np.abs(robot.position_lower), np.abs(robot.position_upper))
    position = _MARGIN * np.where(robot.is_prismatic, np.maximum(reach, 0.1), np.maximum(reach, np.pi))
    own_weight = largest_gravity_torque(robot)
    effort = _MARGIN * np.maximum(robot.effort_limit, np.maximum(own_weight, 0.1 * own_weight.max()))
    return position, _MARGIN * robot.velocity_limit, effort


def largest_gravity_torque(robot: RobotModel) -> FloatArray:
    """Largest |gravity torque| of each joint over random postures, shape (n,) [N m]."""
    rng = np.random.default_rng(0)
    bound = np.where(robot.is_prismatic, 1.0, np.pi)
    lower = np.maximum(robot.position_lower, -bound)
    upper = np.maximum(np.minimum(robot.position_upper, bound), lower)
    postures = rng.uniform(lower, upper, size=(_POSTURES, robot.n))
    return np.asarray(np.max(np.abs([robot.gravity_torque(q) for q in postures]), axis=0))
