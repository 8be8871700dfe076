"""name_imu: what a status says of the IMU of a robot on legs where that is what is wrong."""

from __future__ import annotations

import numpy as np

from sysid_ros.estimators import Estimator
from sysid_ros.floating.stance_log import StanceLog
from sysid_ros.online.leg_parameters import LegParameters

_MOSTLY = 0.5
"""Part of the mass's variance that a doubt must be to be named as its cause."""


def name_imu(
    legs: LegParameters,
    stances: StanceLog,
    estimator: Estimator,
    status: str,
    reason: str,
    doubt: float,
    warnings: dict[str, str],
) -> str:
    """The reason of a status, with what is wrong with the IMU where that is why; what was found of it is warned of, too.

    Args:
        doubt: standard deviation of the mass that the accelerometer's excess over gravity makes, over the whole one.
        warnings: in which the one of the IMU is kept.
    """
    theta, variance = estimator.marginal(slice(0, estimator.p))
    found = legs.told(theta, np.sqrt(variance)) if estimator.noise_known else []
    warnings.pop("imu", None)
    if found:
        warnings["imu"] = " ".join(found)
    if status in ("ok", "no_payload"):
        return reason
    if doubt**2 > _MOSTLY or stances.is_doubtful:
        found.insert(
            0, f"The IMU shows {stances.excess:+.2f} m/s^2 beside gravity and motion: a bias, or impacts that its rate misses."
        )
    return " ".join([reason, *found])
