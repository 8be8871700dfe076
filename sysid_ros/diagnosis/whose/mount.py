"""How a robot is mounted: on a ceiling, a wall or a slope, where gravity is set to come from another side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sysid_ros.diagnosis.whose.coarse_rows import CoarseRows
from sysid_ros.diagnosis.whose.robot_likelihood import JointTorques, inverse
from sysid_ros.diagnosis.whose.robot_trial import Trial
from sysid_ros.effects import EFFECTS
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_OTHERWISE = 0.01
"""Probability that a robot is not mounted as gravity is set, before any data."""
_TURNS = 3
"""Rounds of the search: what links that are inexact weigh depends on where gravity comes from."""
_FEW = 2
"""Each of so many rows is taken."""


class Mount(NamedTuple):
    """Gravity in the axes of the base, shape (3,) [m/s^2], its covariance across itself, shape (3, 3), the log-probability of
    such a direction before any data, and the probability of this one; None before it was weighed."""

    gravity: FloatArray
    covariance: FloatArray
    log_prior: float
    probability: float | None = None


def turned(robot: RobotModel, gravity: FloatArray) -> RobotModel:
    """The same robot under gravity of shape (3,) [m/s^2], in the axes of its base."""
    other = robot.with_links(np.zeros_like(robot.pi))
    other.gravity = np.array(gravity, dtype=float)
    other.model.gravity.linear = other.gravity
    return other


def angle_between(a: FloatArray, b: FloatArray) -> float:
    """Between two vectors of shape (3,) [rad]."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def mounted_otherwise(robot: RobotModel, rows: CoarseRows) -> Mount | None:
    """The direction of gravity that makes torques likeliest, beside inexact links, anything that the arm carries and what each
    joint has of its own, where it is further from that of the model than that of a base that stands askew; None where it is not.

    The torque is linear in gravity: what it takes is least squares with a covariance, as far as that is known. Its size is known.
    """
    size = float(np.linalg.norm(robot.gravity))
    steepest = max(e.between[1] for e in EFFECTS.values() if e.leans and e.between)
    if size == 0.0:
        return None
    here = robot
    for _ in range(_TURNS):
        told = _gravity(here, rows.every(_FEW), size)
        direction = told[0] / max(float(np.linalg.norm(told[0])), 1e-9)
        here = turned(robot, size * direction)
    across = np.eye(3) - np.outer(direction, direction)
    spread = across @ told[1] @ across
    if angle_between(here.gravity, robot.gravity) <= steepest:
        return None
    # a direction within what a base stands askew by, of all that there are
    askew = max(e.size for e in EFFECTS.values() if e.leans)
    return Mount(here.gravity, spread, float(np.log(_OTHERWISE) + np.log(0.5 * askew**2)))


def _gravity(robot: RobotModel, rows: CoarseRows, size: float) -> tuple[FloatArray, FloatArray]:
    """Gravity by least squares, shape (3,) [m/s^2], and its covariance, shape (3, 3)."""
    trial = Trial.of(robot, rows)
    kernels, usual, joints = trial.kernels.level(), float(trial.usual.max()), []
    for j in range(robot.n):
        columns, by_load = kernels.urdf(j, usual)
        residual = rows.tau[:, [j]] - kernels.mean[:, [j]] + kernels.gravity[:, [j]]
        prior = np.concatenate([size * kernels.falls[:, j], columns], axis=1), by_load
        takes = kernels.dissipated(j, float(trial.usual[j]), by_load=True)
        joints.append(JointTorques(residual, prior, kernels.own(j), kernels.pattern, float(trial.usual[j]), takes))
    H = np.eye(joints[0].prior[0].shape[1])
    h = np.zeros(len(H))
    for x in joints:
        sizes = x.usual_sizes(x.residual[:, 0], x.fixed() + x.prior[0] @ x.prior[0].T)
        own, side = x.information(inverse(x.covariance(sizes)))
        H, h = H + own, h + side
    covariance = inverse(H)
    return size * (covariance @ h)[:3], size**2 * covariance[:3, :3]
