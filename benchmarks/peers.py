"""What others do with the same recording: libraries on the same filtered rows, and the usual recipe without a filter."""

from __future__ import annotations

import math

import numpy as np
from filterpy.kalman import KalmanFilter
from padasip.filters import FilterRLS

from sysid_ros.effects import Payload
from sysid_ros.estimators import ConstantForgetting
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement, Sample
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel

PRIOR_STD = np.array([2.0, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
MEMORY = 0.3
"""Time constant of the forgetting [s]: short enough to have forgotten the time before the pick two seconds after it."""
TORQUE_STD = 0.1

Result = tuple[FloatArray, FloatArray | None]


def peers_at(robot: RobotModel, measurements: list[Measurement], known: ModelFile | None, t: float) -> dict[str, Result]:
    """Parameters and covariance (None where the library has none) of each at time ``t``."""
    model = TorqueModel(robot, [Payload(robot)], known.known_effects(robot) if known else [])
    period = float(np.median(np.diff([m.t for m in measurements[:100]])))
    until = [m for m in measurements if m.t <= t]
    return {**_on_filtered_rows(model, until, period), **_unfiltered(model, until, period)}


def _on_filtered_rows(model: TorqueModel, measurements: list[Measurement], period: float) -> dict[str, Result]:
    front_end = FrontEnd(model, period, 100.0)
    keep = math.exp(-front_end.period / MEMORY)
    constant = ConstantForgetting(PRIOR_STD, np.full(model.robot.n, TORQUE_STD**2), keep)
    rls = FilterRLS(10, mu=keep ** (1.0 / model.robot.n), eps=1.0, w="zeros")
    kalman = KalmanFilter(dim_x=10, dim_z=model.robot.n)
    kalman.x, kalman.P, kalman.R = np.zeros(10), np.diag(PRIOR_STD**2), TORQUE_STD**2 * np.eye(model.robot.n)
    kalman.Q = np.diag(PRIOR_STD**2) * 1e-2 * front_end.period
    for rows in (rows for m in measurements for rows in front_end.push(m)):
        constant.update(rows.Y, rows.y)
        for Y, y in zip(rows.Y * PRIOR_STD / TORQUE_STD, rows.y / TORQUE_STD, strict=True):
            rls.adapt(y, Y)
        kalman.predict()
        kalman.update(rows.y, H=rows.Y)
    return {
        "same rows, constant forgetting": (constant.theta, constant.covariance()),
        "same rows, padasip FilterRLS": (PRIOR_STD * rls.w, None),
        "same rows, filterpy KalmanFilter": (kalman.x, kalman.P),
    }


def _unfiltered(model: TorqueModel, measurements: list[Measurement], period: float) -> dict[str, Result]:
    """Velocity and acceleration by differences of the positions, recursive least squares with forgetting at the robot's rate."""
    estimator = ConstantForgetting(PRIOR_STD, np.full(model.robot.n, TORQUE_STD**2), math.exp(-period / MEMORY))
    columns, rest = np.zeros((model.robot.n, 10)), np.zeros(model.robot.n)
    for before, now, after in zip(measurements, measurements[1:], measurements[2:], strict=False):
        v = (after.q - before.q) / (2.0 * period)
        a = (after.q - 2.0 * now.q + before.q) / period**2
        model.split_into(Sample(now.t, now.q, v, a, now.tau), columns, rest)
        estimator.update(columns, rest)
    return {"differences without a filter, constant forgetting": (estimator.theta, estimator.covariance())}
