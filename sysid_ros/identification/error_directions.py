"""The directions in which an identified model's uncertainty makes torque."""

from __future__ import annotations

import numpy as np

from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.torque_model import TorqueModel

_POSTURES = 300


def error_directions(model: TorqueModel, covariance: FloatArray) -> FloatArray:
    """L, shape (p, c), with ``Y L L' Y' = Y covariance Y'`` but for a small part, for motions in the robot's range.

    Most of the covariance of standard parameters lies in combinations that no motion shows; they make no torque and are left out.

    Args:
        model: whose free effects the covariance belongs to. covariance: shape (p, p).
    """
    robot = model.robot
    random = np.random.default_rng(0)
    low, high = np.maximum(robot.position_lower, -np.pi), np.minimum(robot.position_upper, np.pi)
    information = np.zeros((model.p, model.p))
    for _ in range(_POSTURES):
        q, v, a = random.uniform(low, high), random.normal(0.0, 0.5, robot.n), random.normal(0.0, 1.0, robot.n)
        Y, _ = model.split(Sample(0.0, q, v, a, np.zeros(robot.n)))
        # each joint counts by its own noise, or the weak joints of the wrist would not be seen beside the shoulder
        scale = np.sqrt(np.maximum(np.einsum("ia,ab,ib->i", Y, covariance, Y), 1e-30))
        Y = Y / scale[:, None]
        information += Y.T @ Y / _POSTURES
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    power, mix = np.linalg.eigh(root.T @ information @ root)
    directions: FloatArray = root @ mix[:, power > TOL.uncertainty_left_out * power.sum()]
    return directions
