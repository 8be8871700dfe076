"""Checks of the arguments that several effects take."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.exceptions import ModelFileError
from sysid_ros.robot.robot_model import RobotModel


def positive(value: object, what: str, effect: str) -> float:
    """A setting that must be a positive, finite number.

    Raises:
        ModelFileError: it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < np.inf:
        raise ModelFileError(f"effect '{effect}' has {what} {value!r}; it must be a positive number.")
    return float(value)


def of_slide(unit: str) -> str:
    """What a unit of a revolute joint is on a prismatic one: N for N m, m for rad, kg for kg m^2."""
    return unit.replace("(N m)", "N").replace("N m", "N").replace("kg m^2", "kg").replace("rad", "m")


def carrying(robot: RobotModel, links: Sequence[float], effect: str) -> RobotModel:
    """The robot with a change of its links' inertials, shape (10 n,); the robot itself where that is empty.

    Raises:
        ModelFileError: the change is of another shape.
    """
    if len(links) == 0:
        return robot
    if len(links) != 10 * robot.n or not np.isfinite(links).all():
        raise ModelFileError(
            f"effect '{effect}' has {len(links)} numbers as links; it must be {10 * robot.n} finite ones, or none."
        )
    return robot.with_links(np.asarray(links, dtype=float))
