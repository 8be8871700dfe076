"""Which motions an arm may be given."""

from __future__ import annotations

import numpy as np

from sysid_ros.control.timed_motion import TimedMotion
from sysid_ros.exceptions import DataError
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_GRID = 0.01
_NEARLY = 1e-3
"""By which a limit may be exceeded between points, in radians or parts."""


def require_allowed(motion: TimedMotion, jump: FloatArray, robot: RobotModel, tolerance: float) -> None:
    """Refuse a motion that leaves the URDF's ranges or speeds, begins with a jump, or does not end at rest.

    Args:
        jump: from where the arm is wanted to where the motion begins, shape (n,); at most ``tolerance``.

    Raises:
        DataError: what is wrong with it.
    """
    names = robot.joint_names
    far = int(np.argmax(np.abs(jump)))
    if abs(jump[far]) > tolerance:
        raise DataError(
            f"the motion begins {abs(jump[far]):.3f} from where {names[far]} is wanted; {tolerance:g} is "
            "allowed (start_tolerance). Give its first point a later time, in which the arm comes there."
        )
    t, q, v = motion.along(_GRID)
    if np.abs(v[-1]).max() > _NEARLY:
        worst = int(np.argmax(np.abs(v[-1])))
        raise DataError(f"the motion ends with {names[worst]} at {v[-1, worst]:.3f} a second; it must end at rest.")
    beyond = np.maximum(q - robot.position_upper, robot.position_lower - q).max(axis=0)
    if beyond.max() > _NEARLY:
        worst = int(np.argmax(beyond))
        raise DataError(
            f"the motion takes {names[worst]} from {q[:, worst].min():.3f} to {q[:, worst].max():.3f}; the URDF allows "
            f"{robot.position_lower[worst]:.3f} to {robot.position_upper[worst]:.3f}."
        )
    ratio = np.abs(v).max(axis=0) / robot.velocity_limit
    if ratio.max() > 1.0 + _NEARLY:
        worst = int(np.argmax(ratio))
        when = t[np.argmax(np.abs(v[:, worst]))]
        raise DataError(
            f"the motion moves {names[worst]} at {np.abs(v[:, worst]).max():.2f} a second after {when:.2f} s; the URDF "
            f"allows {robot.velocity_limit[worst]:.2f}. Give it more time."
        )
