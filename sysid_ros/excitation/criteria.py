"""Excitation criteria: how well a motion would determine the base parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.effects import Effect
from sysid_ros.excitation.motion_limits import MotionLimits
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.torque.base_parameters import BaseParameters
from sysid_ros.torque.torque_model import TorqueModel

_STATES = 500
_STEP = 1e-6


@dataclass(frozen=True, slots=True)
class Criteria:
    """Of the information M that a sample holds on average about the r scaled base parameters.

    Attributes:
        d: ``log det M``, the larger the better: the volume of the joint confidence region is ``exp(-d / 2)``.
        a: ``trace(M^-1) / r``, the smaller the better: the mean variance.
        e: the smallest eigenvalue of M, the larger the better: the worst combination of parameters.
        condition_number: of the weighted regressor, each column scaled to unit length.
        unweighted_condition_number: the same with all joints weighted alike.
    """

    d: float
    a: float
    e: float
    condition_number: float
    unweighted_condition_number: float


class ExcitationCriteria:
    """Information about base parameters: ``M = 1/N sum_t S Y_b' W Y_b S``.

    Y_b are the base columns of the free effects; W weights each joint by the inverse square of its torque noise, taken to be in
    proportion to its effort limit; S scales each column to unit power over random states within the limits. So criteria compare
    motions under the same limits. References: Gautier, Khalil 1992; Swevers et al. 1997, section IV.

    Args:
        model: whose free effects are to be identified. limits: the states that the robot may reach.

    Attributes:
        base: the base parameters. names: of the independent parameters, r names. weight: of each joint's row, shape (n,).
    """

    def __init__(self, model: TorqueModel, limits: MotionLimits) -> None:
        self.model, self.robot = model, model.robot
        q, v, a = random_states(limits, _STATES)
        torque = limits.torque(q, v, a)
        typical = np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 1e-9)
        # where no effort limit is stated, about what a motor for this joint would be built for
        size = np.where(np.isfinite(limits.effort), limits.effort, 3.0 * typical)
        self.weight: FloatArray = float(np.exp(np.mean(np.log(size)))) / size
        Y = self._rows(q, v, a)
        self.base = BaseParameters(np.einsum("kia,kib->ab", Y, Y) / _STATES, TOLERANCES.visible)
        self.columns = np.sort(self.base.independent)
        self.names = tuple(model.parameter_names[i] for i in self.columns)
        weighted = self.weight[:, None] * Y[:, :, self.columns]
        self._scale: FloatArray = 1.0 / np.sqrt(np.einsum("kia,kia->a", weighted, weighted) / _STATES)
        # a search by gradients can't see the step of dry friction between two of its samples
        self._smooth = TorqueModel(
            self.robot, [e.smoothed(TOLERANCES.smooth * float(np.min(limits.velocity[e.joints]))) for e in model.free]
        )

    def _rows(self, q: FloatArray, v: FloatArray, a: FloatArray, model: TorqueModel | None = None) -> FloatArray:
        """Columns of all free effects at N states, shape (N, n, p)."""
        motion = _states(self.robot, q, v, a)
        return np.concatenate([effect.columns_along(motion) for effect in (model or self.model).free], axis=2)

    def rows(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Base columns at N states, not scaled, shape (N, n, r)."""
        return self._rows(q, v, a)[:, :, self.columns]

    def evaluate(self, q: FloatArray, v: FloatArray, a: FloatArray) -> Criteria:
        """Criteria of N states, evenly spaced in time, each of shape (N, n)."""
        Y = self.rows(q, v, a)
        weighted = Y * self.weight[:, None] * self._scale
        values = np.linalg.eigvalsh(np.einsum("kia,kib->ab", weighted, weighted) / len(q))
        if values[0] <= 1e-14 * values[-1]:
            return Criteria(-np.inf, np.inf, 0.0, np.inf, np.inf)
        return Criteria(
            d=float(np.sum(np.log(values))),
            a=float(np.mean(1.0 / values)),
            e=float(values[0]),
            condition_number=_equilibrated_condition(weighted),
            unweighted_condition_number=_equilibrated_condition(Y),
        )

    def negative_d(self, q: FloatArray, v: FloatArray, a: FloatArray) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        """-D of N states and its derivatives by q, v and a, each of shape (N, n); dry friction smoothed.

        The derivative is ``dD = 2/N sum_t <W Y_b S M^-1 S, dY_b>``, with those of the columns by differences.
        """
        count, r = len(q), len(self.columns)
        rows = self._rows(q, v, a, self._smooth)
        weighted = rows[:, :, self.columns] * self.weight[:, None] * self._scale
        information = np.einsum("kia,kib->ab", weighted, weighted, optimize=True) / count + 1e-12 * np.eye(r)
        sign, value = np.linalg.slogdet(information)
        assert sign > 0.0
        direction = np.zeros_like(rows)
        inner = (weighted @ np.linalg.inv(information)) * self.weight[:, None] * self._scale
        direction[:, :, self.columns] = -2.0 / count * inner
        gradients = np.zeros((3, count, self.robot.n))
        for effect, where in zip(self._smooth.free, self._smooth.slices, strict=True):
            gradients += _column_gradient(effect, np.stack([q, v, a]), rows[:, :, where], direction[:, :, where])
        return -float(value), gradients[0], gradients[1], gradients[2]


def random_states(limits: MotionLimits, count: int, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """States spread evenly over what the limits of position, velocity and acceleration allow, each of shape (count, n)."""
    random = np.random.default_rng(seed)
    n = limits.robot.n
    return (
        random.uniform(limits.lower, limits.upper, (count, n)),
        random.uniform(-limits.velocity, limits.velocity, (count, n)),
        random.uniform(-limits.acceleration, limits.acceleration, (count, n)),
    )


def _equilibrated_condition(rows: FloatArray) -> float:
    information = np.einsum("kia,kib->ab", rows, rows)
    scale = 1.0 / np.sqrt(np.diag(information))
    values = np.linalg.eigvalsh(information * np.outer(scale, scale))
    return float(np.sqrt(values[-1] / max(values[0], 1e-300)))


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
