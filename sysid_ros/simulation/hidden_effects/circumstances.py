"""Circumstances: what is usual for an arm in a motion, so that an effect can be drawn that shows and is not absurd."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.hidden_effects.motion import PlannedMotion

_GRID = 0.02
_LEAST_SHARE = 0.03


@dataclass
class Circumstances:
    """What a draw may depend on.

    Args:
        robot: the nominal model. motion: the one that is fitted. rng: where everything comes from.
        scale: multiplies the sizes; 1 is usual.
        torque_noise: standard deviation of the efforts, shape (n,) [N m]; a resolution is drawn relative to it.
        only: the joint where it has to be; None: any.
        rated: torque that each joint is built for, shape (n,) [N m]; None: the URDF's effort limit.
    """

    robot: RobotModel
    motion: PlannedMotion
    rng: np.random.Generator
    scale: float
    torque_noise: FloatArray
    only: int | None = None
    rated: FloatArray | None = None

    def __post_init__(self) -> None:
        self.t = np.arange(0.0, self.motion.duration, _GRID)
        self.q, self.v, self.a = self.motion.sample(self.t)
        self.tau = self.robot.rnea_along(self.q, self.v, self.a)
        self.torque = torque_scale(self.tau)
        self.speed = np.sqrt(np.mean(self.v**2, axis=0))
        self.acceleration = np.sqrt(np.mean(self.a**2, axis=0))
        self.effort = self.robot.effort_limit if self.rated is None else self.rated

    @cached_property
    def inertia(self) -> FloatArray:
        """Mean of the mass matrix' diagonal, shape (n,) [kg m^2]."""
        still, rows = np.zeros(self.robot.n), self.q[::25]
        gravity = self.robot.rnea_along(rows, np.zeros_like(rows), np.zeros_like(rows))
        diagonal = np.empty_like(rows)
        for j in range(self.robot.n):
            unit = still.copy()
            unit[j] = 1.0
            columns = self.robot.rnea_along(rows, np.zeros_like(rows), np.tile(unit, (len(rows), 1)))
            diagonal[:, j] = columns[:, j] - gravity[:, j]
        return np.asarray(diagonal.mean(axis=0))

    @cached_property
    def gravity(self) -> FloatArray:
        """Torque that gravity costs along the motion, shape (K, n) [N m]."""
        still = np.zeros_like(self.q)
        return self.robot.rnea_along(self.q, still, still)

    @property
    def mass(self) -> float:
        """Of all moving links [kg]."""
        return float(self.robot.pi.reshape(-1, 10)[:, 0].sum())

    def uniform(self, low: float, high: float) -> float:
        """A number between low and high."""
        return float(self.rng.uniform(low, high))

    def share(self, low: float, high: float) -> float:
        """A size relative to what is usual, evenly spread in its logarithm, times ``scale``."""
        return self.scale * float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def of_effort(self, low: float, high: float) -> list[float]:
        """A size for each joint, evenly spread in its logarithm, as a part of what the joint is built for; not scaled."""
        return (self.effort * np.exp(self.rng.uniform(np.log(low), np.log(high), self.robot.n))).tolist()  # type: ignore[no-any-return]

    def sign(self) -> float:
        """1 or -1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def some_joints(self) -> list[int]:
        """Most often one joint, sometimes two, sometimes all."""
        if self.only is not None:
            return [self.only]
        n = self.robot.n
        count = int(self.rng.choice([1, 2, n], p=[0.65, 0.2, 0.15]))
        return sorted(self.rng.choice(n, size=count, replace=False).tolist())

    def one_joint(self, allowed: NDArray[np.bool_] | None = None) -> int:
        """One joint, among those where ``allowed`` (n,) is true if any is."""
        if self.only is not None:
            return self.only
        n = self.robot.n
        pool = np.flatnonzero(allowed) if allowed is not None and np.any(allowed) else np.arange(n)
        return int(self.rng.choice(pool))


def torque_scale(tau: FloatArray) -> FloatArray:
    """Usual torque of each joint, shape (n,) [N m]: the rms of (N, n), and at least 3 % of the strongest joint's."""
    rms = np.sqrt(np.mean(tau**2, axis=0))
    return np.asarray(np.maximum(rms, _LEAST_SHARE * rms.max()))
