"""ArmRows: columns of an arm's free effects along motions of its joints, and their derivatives."""

from __future__ import annotations

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.excitation.motion_limits import MotionLimits
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.torque.torque_model import TorqueModel

_STATES = 500
_STEP = 1e-6


class ArmRows:
    """Rows of the joints of an arm: see :class:`.criteria.MotionRows`.

    The torque noise of each joint is taken to be in proportion to its effort limit.

    Args:
        model: whose free effects are to be identified. limits: the states that the robot may reach.
    """

    precision: FloatArray | None = None

    def __init__(self, model: TorqueModel, limits: MotionLimits) -> None:
        self._model, self._robot, self.names = model, model.robot, tuple(model.parameter_names)
        self._states = random_states(limits, _STATES)
        torque = limits.torque(*self._states)
        typical = np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 1e-9)
        # where no effort limit is stated, about what a motor for this joint would be built for
        size = np.where(np.isfinite(limits.effort), limits.effort, 3.0 * typical)
        self.weight: FloatArray = float(np.exp(np.mean(np.log(size)))) / size
        self._smooth = smoothed(model, limits.velocity)

    def usual(self) -> FloatArray:
        """Columns at random states."""
        return self.columns(*self._states)

    def columns(self, q: FloatArray, v: FloatArray, a: FloatArray, smooth: bool = False) -> FloatArray:
        """Columns of all free effects at N states, shape (N, n, p)."""
        motion = _states(self._robot, q, v, a)
        free = (self._smooth if smooth else self._model).free
        return np.concatenate([effect.columns_along(motion) for effect in free], axis=2)

    def gradient(self, q: FloatArray, v: FloatArray, a: FloatArray, columns: FloatArray, direction: FloatArray) -> FloatArray:
        """By differences of the columns."""
        gradients = np.zeros((3, len(q), self._robot.n))
        for effect, where in zip(self._smooth.free, self._smooth.slices, strict=True):
            gradients += _column_gradient(effect, np.stack([q, v, a]), columns[:, :, where], direction[:, :, where])
        return gradients


def smoothed(model: TorqueModel, velocity: FloatArray) -> TorqueModel:
    """The model with dry friction that turns within a part of the limits of velocity, shape (n,): a search by gradients can't see
    a step between two of its samples."""
    return TorqueModel(model.robot, [e.smoothed(TOLERANCES.smooth * float(np.min(velocity[e.joints]))) for e in model.free])


def random_states(limits: MotionLimits, count: int, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """States spread evenly over what the limits of position, velocity and acceleration allow, each of shape (count, n)."""
    random = np.random.default_rng(seed)
    n = limits.robot.n
    return (
        random.uniform(limits.lower, limits.upper, (count, n)),
        random.uniform(-limits.velocity, limits.velocity, (count, n)),
        random.uniform(-limits.acceleration, limits.acceleration, (count, n)),
    )


def _states(robot: RobotModel, q: FloatArray, v: FloatArray, a: FloatArray) -> Motion:
    return Motion(robot, np.arange(len(q), dtype=np.float64), q, v, a, np.zeros_like(q))


def _column_gradient(effect: Effect, states: FloatArray, columns: FloatArray, direction: FloatArray) -> FloatArray:
    """Derivative of ``<direction, columns>`` of each state by q, v and a, shape (3, N, n), by differences.

    Args:
        states: q, v and a, shape (3, N, n). columns: of the effect there, shape (N, n, p). direction: shape (N, n, p).
    """
    robot, n = effect.robot, effect.robot.n
    gradient = np.zeros(states.shape)
    # columns are affine in the acceleration, where a long step costs nothing
    steps = (_STEP, _STEP, 1.0)
    if effect.diagonal is not None and not effect.depends_on:
        # a joint's column depends on that joint alone, so all can be moved together
        for kind, step in enumerate(steps):
            moved = np.array(states)
            moved[kind] += step
            change = effect.columns_along(_states(robot, *moved)) - columns
            gradient[kind] = np.einsum("kia,kia->ki", change, direction) / step
        return gradient
    for kind, step in enumerate(steps):
        for j in range(n):
            moved = np.array(states)
            moved[kind, :, j] += step
            change = effect.columns_along(_states(robot, *moved)) - columns
            gradient[kind, :, j] = np.einsum("kia,kia->k", change, direction) / step
    return gradient
