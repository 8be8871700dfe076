"""DiagnosisMotion: fast, then slow, with rests: what a diagnosis needs to see."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.trajectory import ExcitingTrajectory

_WIDEST = 2.4
_AMPLITUDE = 1.3
_SPEED_SHARE = 0.7
_EFFORT_SHARE = 0.8
_SLOW_AMPLITUDE = 0.4


class PlannedMotion(Protocol):
    """A motion from its beginning to its end at ``duration`` [s]."""

    duration: float

    def sample(self, t: NDArray[np.floating[Any]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration, each of shape (len(t), n), at the times t [s]."""


class DiagnosisMotion:
    """Rest, a fast Fourier series, a short rest, a slow one, rest, all about one posture; within the limits of the arm.

    Friction shows in the slow part and in the reversals, inertia in the fast one, offsets and gravity at rest.

    Args:
        robot: its limits of position, velocity and effort, and the torque that the motion costs.
        rng: posture and coefficients.
        fast, slow: length of the two parts [s].
        rest: length of each of the three rests [s].

    Attributes:
        duration: [s].
        centre: the posture, shape (n,) [rad].
    """

    def __init__(self, robot: RobotModel, rng: np.random.Generator, fast: float, slow: float, rest: float = 0.8) -> None:
        lower, upper = np.maximum(robot.position_lower, -_WIDEST), np.minimum(robot.position_upper, _WIDEST)
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        limit = np.where(np.isfinite(robot.effort_limit), robot.effort_limit, np.inf) * _EFFORT_SHARE
        for _ in range(50):
            self.centre: FloatArray = middle + 0.35 * half * rng.uniform(-1.0, 1.0, robot.n)
            if np.all(np.abs(robot.gravity_torque(self.centre)) < 0.7 * limit):
                break
        top_speed = _SPEED_SHARE * np.minimum(robot.velocity_limit, rng.uniform(1.6, 2.6))
        self._parts: list[tuple[float, ExcitingTrajectory]] = []
        at = rest
        for length, speed, acceleration, frequency, amplitude in (
            (fast, top_speed, rng.uniform(5.0, 9.0), rng.uniform(0.08, 0.14), _AMPLITUDE),
            (slow, np.full(robot.n, rng.uniform(0.12, 0.25)), 2.0, rng.uniform(0.08, 0.12), _SLOW_AMPLITUDE),
        ):
            trajectory = ExcitingTrajectory(
                self.centre,
                lower,
                upper,
                rng,
                velocity_limit=np.asarray(speed),
                acceleration_limit=acceleration,
                base_frequency=frequency,
                amplitude_limit=amplitude,
                duration=length,
                blend=1.2,
            )
            trajectory.limit_effort(robot.rnea, limit)
            self._parts.append((at, trajectory))
            at += length + rest
        self.duration = at

    def sample(self, t: NDArray[np.floating[Any]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration, each of shape (len(t), n), at the times t [s]."""
        q = np.tile(self.centre, (len(t), 1))
        v, a = np.zeros_like(q), np.zeros_like(q)
        for begin, trajectory in self._parts:
            inside = (t >= begin) & (t <= begin + trajectory.duration)
            q[inside], v[inside], a[inside] = trajectory.sample(np.asarray(t[inside] - begin, dtype=np.float64))
        return q, v, a
