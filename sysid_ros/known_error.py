"""KnownError: what the uncertainty of an identified model does to the torque, in few directions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects import LinkInertia, RotorInertia
from sysid_ros.known_effect import KnownEffect
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_POSTURES = 200
_LEFT_OUT = 1e-3


class KnownError:
    """``error of the known torque = Z z``, z ~ N(0, 1): link and rotor inertias as uncertain as their covariance says.

    Only the directions of the covariance that make torque in the robot's range are kept; those that no motion shows make none.
    Friction is not in it: the online estimation corrects that itself.

    Args:
        robot: the arm. known: effects with their covariance.

    Attributes:
        c: number of directions kept; 0 where nothing is known to be uncertain.
    """

    def __init__(self, robot: RobotModel, known: Sequence[KnownEffect]) -> None:
        n = robot.n
        self.c = 0
        self._links = np.zeros((10 * n, 0))
        self._rotors = np.zeros((n, 0))
        links = [k for k in known if isinstance(k.effect, LinkInertia) and k.covariance is not None]
        if not links:
            return
        rotors = [k for k in known if isinstance(k.effect, RotorInertia) and k.covariance is not None]
        covariance = np.zeros((11 * n, 11 * n))
        places = [np.array([10 * j + i for j in k.effect.joints for i in range(10)]) for k in links]
        for k, place in zip([*links, *rotors], [*places, *(10 * n + k.effect.joints for k in rotors)], strict=True):
            assert k.covariance is not None
            covariance[np.ix_(place, place)] = k.covariance
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        seen = self._information(robot)
        power, mix = np.linalg.eigh(root.T @ seen @ root)
        kept = power > _LEFT_OUT * power.sum()
        directions = root @ mix[:, kept]
        self.c = directions.shape[1]
        self._links, self._rotors = directions[: 10 * n], directions[10 * n :]

    @staticmethod
    def _information(robot: RobotModel) -> FloatArray:
        """Mean of Y' Y of links and rotors over postures in the robot's range, shape (11 n, 11 n)."""
        n = robot.n
        random = np.random.default_rng(0)
        low, high = np.maximum(robot.position_lower, -np.pi), np.minimum(robot.position_upper, np.pi)
        information = np.zeros((11 * n, 11 * n))
        for _ in range(_POSTURES):
            q, v, a = random.uniform(low, high), random.normal(0.0, 0.5, n), random.normal(0.0, 1.0, n)
            Y = np.hstack([robot.regressor(q, v, a), np.diag(a)])
            information += Y.T @ Y / _POSTURES
        return information

    def fill(self, regressor: FloatArray, a: FloatArray, out: FloatArray) -> None:
        """Write Z into ``out`` of shape (n, c), from the links' regressor (n, 10 n) and the accelerations (n,)."""
        np.matmul(regressor, self._links, out=out)
        out += a[:, None] * self._rotors
