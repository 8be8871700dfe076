"""The torque error to be expected on other motions than those that were recorded, and the directions that it comes from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.identification.held_out import Solvers
from sysid_ros.identification.least_squares import Fit
from sysid_ros.identification.link_posterior import LinkPosterior
from sysid_ros.identification.rows import BagRows
from sysid_ros.identification.tolerances import TOL
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.torque.torque_model import TorqueModel

_POSTURES = 400
_POSTURES_OF_DIRECTIONS = 300


class ExpectedError:
    """Mean squared torque error of theta beside that of the URDF's links with friction, u, over motions of the robot's range.

    With Phi_j the mean of y_j' y_j over these motions, y_j the row of joint j, and the parameters N(m, C) after the data:
    ``E_j(theta) = s_j^2 + tr(Phi_j C) + (theta - m)' Phi_j (theta - m)``, s_j^2 the noise. The difference to E_j(u) is linear in
    the true parameters, so its standard deviation is ``2 sqrt((theta - u)' Phi_j C Phi_j (theta - u))``.

    Args:
        bags: whose speed and acceleration the motions have; their postures are all that the joints' limits allow.
        found, solvers: how parameters follow from weights of the prior. posterior: N(m, C).
    """

    def __init__(self, bags: Sequence[BagRows], found: Fit, solvers: Solvers, posterior: LinkPosterior) -> None:
        self._found, self._solvers, self._mean = found, solvers, posterior.mean
        self._rows = _gram(solvers.model, bags)
        covariance = posterior.covariance
        self._risk = np.einsum("jab,bc,jcd->jad", self._rows, covariance, self._rows, optimize=True)
        count = np.maximum(found.sums.count, 1e-12)
        noise = np.sum(found.squares * count, axis=0) / count.sum(axis=0)
        self._least = noise + np.einsum("jab,ab->j", self._rows, covariance)
        self._urdf = solvers.approximate(found.information, found.score, np.inf)
        self._of_urdf = self._at(self._urdf)

    def _at(self, theta: FloatArray) -> FloatArray:
        away = theta - self._mean
        error: FloatArray = self._least + np.einsum("jab,a,b->j", self._rows, away, away)
        return np.maximum(error, 1e-300)

    def compare(self, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """E_j(theta) / E_j(u) of the parameters for weights of the links, shape (n,), and the ratio it may reach by bad luck.

        Args:
            weights: one a link, ``inf`` keeps it.
        """
        theta = self._solvers.approximate(self._found.information, self._found.score, weights)
        error, change = self._at(theta), theta - self._urdf
        std = 2.0 * np.sqrt(np.maximum(np.einsum("jab,a,b->j", self._risk, change, change), 0.0))
        return error / self._of_urdf, (error + TOL.risk_sure * std) / self._of_urdf


def _gram(model: TorqueModel, bags: Sequence[BagRows]) -> FloatArray:
    """Mean of y_j' y_j over random postures, speeds and accelerations, shape (n, p, p)."""
    robot, random = model.robot, np.random.default_rng(0)
    low, high = np.maximum(robot.position_lower, -np.pi), np.minimum(robot.position_upper, np.pi)
    speed = np.sqrt(np.mean([np.mean(bag.v**2, axis=0) for bag in bags], axis=0))
    acceleration = np.sqrt(np.mean([np.mean(bag.a**2, axis=0) for bag in bags], axis=0))
    rows: FloatArray = np.empty((_POSTURES, robot.n, model.p))
    for k in range(_POSTURES):
        q = random.uniform(low, high)
        v, a = speed * random.normal(size=robot.n), acceleration * random.normal(size=robot.n)
        rows[k], _ = model.split(Sample(0.0, q, v, a, np.zeros(robot.n)))
    return np.asarray(np.einsum("kja,kjb->jab", rows, rows, optimize=True) / _POSTURES)


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
    for _ in range(_POSTURES_OF_DIRECTIONS):
        q, v, a = random.uniform(low, high), random.normal(0.0, 0.5, robot.n), random.normal(0.0, 1.0, robot.n)
        Y, _ = model.split(Sample(0.0, q, v, a, np.zeros(robot.n)))
        # each joint counts by its own noise, or the weak joints of the wrist would not be seen beside the shoulder
        scale = np.sqrt(np.maximum(np.einsum("ia,ab,ib->i", Y, covariance, Y), 1e-30))
        Y = Y / scale[:, None]
        information += Y.T @ Y / _POSTURES_OF_DIRECTIONS
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    power, mix = np.linalg.eigh(root.T @ information @ root)
    return np.asarray(root @ mix[:, power > TOL.uncertainty_left_out * power.sum()])
