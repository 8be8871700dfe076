"""What makes an arm yield: an error or a speed that is too large, states that come too slowly."""

from __future__ import annotations

from typing import Final

import numpy as np

from sysid_ros.control.state_age import StatePeriod
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

TOO_FAST: Final = 1.5
"""Speed in parts of the URDF's limit from which something is wrong."""
_JITTER: Final = 1.05


def loop_fault(robot: RobotModel, error: FloatArray, v: FloatArray, error_limit: float, period: StatePeriod, delay: float) -> str:
    """What is wrong, in a sentence; "" where nothing is.

    Args:
        error, v: distance from the motion and velocity, shape (n,) each. error_limit: of any joint. period: of the states.
        delay: that the gains are made for [s].
    """
    far, fast = np.abs(error), np.abs(v) / robot.velocity_limit
    j, k = int(np.argmax(far)), int(np.argmax(fast))
    names, end = robot.joint_names, "The arm yields, its weight held, until ~/hold"
    # not >, so that NaN is a fault too
    if not far[j] <= error_limit:
        return f"{names[j]} was {far[j]:.2f} from where it should be; {error_limit:g} is allowed (error_limit). {end}"
    if not fast[k] <= TOO_FAST:
        return f"{names[k]} moved at {abs(v[k]):.1f} a second, {fast[k]:.1f} times what the URDF allows. {end}"
    if period.known and not period.mean <= _JITTER * delay:
        every, assumed = 1e3 * period.mean, 1e3 * delay
        text = f"The joint states come every {every:.1f} ms; the gains are for a loop_delay of {assumed:g} ms. Set it to more."
        return f"{text} {end}"
    return ""
