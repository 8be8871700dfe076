"""MotionOptimiser: the way from a motion to a local optimum, by gradients; MotionConstraints: its limits as inequalities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Generic, Protocol, TypeVar

import numpy as np

from sysid_ros.excitation.criteria import ExcitationCriteria
from sysid_ros.excitation.feasibility import Feasibility, Sampled, Use
from sysid_ros.excitation.fourier_trajectory import FourierBasis, FourierTrajectory
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

_NEGLIGIBLE = 1e-4


class Box(Protocol):
    """Where positions may be, and about how large velocities and accelerations are, shape (n,) each."""

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class Limiting(Protocol):
    """Limits that a motion keeps or not."""

    @property
    def limits(self) -> Box:
        """The box in which it is looked for."""

    def use(self, trajectory: Sampled, step: float = ...) -> Use:
        """What a motion uses of its limits."""

    def keeps(self, trajectory: Sampled) -> bool:
        """Whether it keeps all of them."""


class Constraints(Protocol):
    """Limits as inequalities ``g(C) <= 1``."""

    functions: tuple[FloatArray, FloatArray, FloatArray]

    def motion(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The motion at the instants of ``functions``, shape (N, n) each."""

    def evaluate(self, coefficients: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
        """g, shape (m,), and its derivative by the coefficients, shape (m, K, n)."""

    def exact(self, use: Use) -> FloatArray:
        """g without smoothing, from what a motion uses, shape (m,)."""


F = TypeVar("F", bound=Limiting)
F_in = TypeVar("F_in", contravariant=True)


class ConstraintsOf(Protocol[F_in]):
    """Makes inequalities of limits."""

    def __call__(self, feasibility: F_in, basis: FourierBasis, samples: int) -> Constraints:
        """Of motions in a basis, looked at at so many instants in a period."""


class MotionConstraints:
    """``g_i(C) = smooth max over time of the use of limit i``; the limit is kept where ``g_i <= 1``.

    One inequality for each joint and kind of limit, and for each pair of links; the maximum is smoothed by
    ``log(sum exp(rho u)) / rho``, which lies above it (Kreisselmeier, Steinhauser 1979).

    Args:
        feasibility: the limits. basis: of the motion, whose coefficients C of shape (K, n) are the variables.
        samples: instants in a period at which the limits are looked at.

    Attributes:
        functions: the basis and its derivatives at those instants, shape (N, K) each.
    """

    def __init__(self, feasibility: Feasibility, basis: FourierBasis, samples: int) -> None:
        self._limits, self._collision = feasibility.limits, feasibility.collision
        self.functions = basis.functions(np.arange(samples) * basis.period / samples)

    def motion(self, coefficients: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """q, v and a at the instants, shape (N, n) each."""
        value, first, second = self.functions
        return value @ coefficients, first @ coefficients, second @ coefficients

    def evaluate(self, coefficients: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
        """g, shape (m,), and its derivative by the coefficients, shape (m, K, n); ``sharpness`` is rho."""
        q, v, a = self.motion(coefficients)
        limits = self._limits
        n = limits.robot.n
        use = limits.use(q, v, a, limits.torque(q, v, a))
        value, weight = smooth_max(np.concatenate([use, -use], axis=1), sharpness)
        weight = weight[:, : len(q)] - weight[:, len(q) :]
        gradient = np.zeros((4, n, coefficients.shape[0], n))
        scales = (0.5 * (limits.upper - limits.lower), limits.velocity, limits.acceleration)
        for kind, (function, scale) in enumerate(zip(self.functions, scales, strict=True)):
            for j in range(n):
                gradient[kind, j, :, j] = weight[kind, :, j] @ function / scale[j]
        gradient[3] = self._torque_gradient(q, v, a, weight[3] / limits.effort)
        if self._collision is None:
            return value.ravel(), gradient.reshape(4 * n, *coefficients.shape)
        near, near_gradient = self._nearness(q, sharpness)
        return np.concatenate([value.ravel(), near]), np.concatenate(
            [gradient.reshape(4 * n, *coefficients.shape), near_gradient]
        )

    @staticmethod
    def exact(use: Use) -> FloatArray:
        """g without smoothing, from what a motion uses, shape (m,)."""
        return np.concatenate([use.limits.ravel(), 1.0 - use.room / TOLERANCES.depth])

    def _torque_gradient(self, q: FloatArray, v: FloatArray, a: FloatArray, weight: FloatArray) -> FloatArray:
        """Of the weighted torques, shape (n, K, n)."""
        n = self._limits.robot.n
        total = np.zeros((n, self.functions[0].shape[1], n))
        for function, derivative in zip(self.functions, self._limits.torque_derivatives(q, v, a), strict=True):
            total += np.einsum("ti,tij,tk->ikj", weight, derivative, function, optimize=True)
        return total

    def _nearness(self, q: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
        """Smooth maximum of ``1 - room / depth`` for each pair, shape (P,), and its derivative, shape (P, K, n)."""
        assert self._collision is not None
        room = np.array([self._collision.room(x) for x in q])
        value, weight = smooth_max((1.0 - room / TOLERANCES.depth)[None], sharpness)
        value, weight = value[0], weight[0]
        gradient = np.zeros((room.shape[1], self.functions[0].shape[1], q.shape[1]))
        matters = (weight > _NEGLIGIBLE) & (value > 0.0)
        for k in np.flatnonzero(matters.any(axis=1)):
            self._collision.room(q[k])
            pairs = np.flatnonzero(matters[k])
            by_posture = -weight[k, pairs, None] / TOLERANCES.depth * self._collision.room_gradient(q[k], pairs.tolist())
            gradient[pairs] += self.functions[0][k][None, :, None] * by_posture[:, None, :]
        return value, gradient


def smooth_max(values: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
    """Over the second axis of values of shape (c, N, n): the smooth maximum, shape (c, n), and its derivative, (c, N, n)."""
    top = values.max(axis=1, keepdims=True)
    parts = np.exp(sharpness * (values - top))
    total = parts.sum(axis=1, keepdims=True)
    return top[:, 0] + np.log(total[:, 0]) / sharpness, parts / total


_SAMPLES_PER_HARMONIC = 20
_LEAST_SAMPLES = 100
_EXACT_STEP = 0.004
_CAUTION = 0.1
"""Factor on D for each parameter: the first steps go by the gradient itself, and shall not be wider than a joint's range."""
_TOLERANCE = 3e-5 * _CAUTION


_WIDEST = 3.0


@dataclass(frozen=True, slots=True)
class Stage:
    """One run of the optimiser.

    Attributes:
        sharpness: of the smooth maximum over time. iterations: at most.
        exact: the smooth maximum is corrected by what the first motion really uses.
    """

    sharpness: float
    iterations: int
    exact: bool


class MotionOptimiser(Generic[F]):
    """Maximises ``D(C)`` under the smooth limits ``g(C) <= 1``, C the coefficients of a Fourier series.

    Sequential quadratic programming (scipy's SLSQP; Kraft 1988), in units of what the limits of each joint allow. It may stop
    anywhere; of all iterates the one is returned that would be best once it is shrunk to the limits.

    Args:
        criteria: what is maximised. feasibility: the limits. constraints: what makes inequalities of them.
        basis: of the motions. Where it is anchored, the posture of the first row stays.
    """

    def __init__(self, criteria: ExcitationCriteria, feasibility: F, basis: FourierBasis, constraints: ConstraintsOf[F]) -> None:
        self._criteria, self._feasibility, self._basis = criteria, feasibility, basis
        self._constraints = constraints(feasibility, basis, max(_LEAST_SAMPLES, _SAMPLES_PER_HARMONIC * basis.harmonics))
        self._fixed = 1 if basis.anchored else 0
        limits = feasibility.limits
        room = 0.5 * (limits.upper - limits.lower)
        slowest = basis.omega[0]
        swing = np.min([room, limits.velocity / slowest, limits.acceleration / slowest**2], axis=0)
        self._unit: FloatArray = np.vstack([room, np.tile(swing, (basis.size - 1, 1))])
        lowest, highest = np.full(self._unit.shape, -_WIDEST), np.full(self._unit.shape, _WIDEST)
        lowest[0], highest[0] = limits.lower / room, limits.upper / room
        self._bounds = list(zip(lowest[self._fixed :].ravel(), highest[self._fixed :].ravel(), strict=True))

    def run(self, begin: FourierTrajectory, stage: Stage, progress: Callable[[], None] = lambda: None) -> FourierTrajectory:
        """The best motion on the way from ``begin``; it may exceed limits a little. ``progress`` is called for each iteration."""
        from scipy.optimize import minimize

        start = (begin.coefficients / self._unit)[self._fixed :].ravel()
        scale = _CAUTION / len(self._criteria.columns)
        correction = self._correction(begin, stage)

        # the optimiser asks for value and derivative one after the other
        @lru_cache(maxsize=1)
        def objective(key: bytes) -> tuple[float, FloatArray]:
            value, gradient = self._negative_d(self._coefficients(begin, np.frombuffer(key)))
            return scale * value, scale * gradient

        @lru_cache(maxsize=1)
        def inequality(key: bytes) -> tuple[FloatArray, FloatArray]:
            value, gradient = self._constraints.evaluate(self._coefficients(begin, np.frombuffer(key)), stage.sharpness)
            by_variable = (gradient * self._unit)[:, self._fixed :].reshape(len(value), -1)
            return TOLERANCES.limit - (value - correction), -by_variable

        best, best_merit = start, np.inf

        def look(x: FloatArray) -> None:
            nonlocal best, best_merit
            excess = max(0.0, -float(inequality(x.tobytes())[0].min()))
            merit = objective(x.tobytes())[0] + _CAUTION * TOLERANCES.shrinking * excess
            if merit < best_merit:
                best, best_merit = np.array(x), merit

        def step(x: FloatArray) -> None:
            look(x)
            progress()

        look(start)
        minimize(
            lambda x: objective(x.tobytes())[0],
            start,
            jac=lambda x: objective(x.tobytes())[1],
            bounds=self._bounds,
            constraints=[
                {"type": "ineq", "fun": lambda x: inequality(x.tobytes())[0], "jac": lambda x: inequality(x.tobytes())[1]}
            ],
            method="SLSQP",
            callback=step,
            options={"maxiter": stage.iterations, "ftol": _TOLERANCE},
        )
        return FourierTrajectory(self._basis, self._coefficients(begin, best))

    def _coefficients(self, begin: FourierTrajectory, x: FloatArray) -> FloatArray:
        free = x.reshape(-1, begin.n) * self._unit[self._fixed :]
        return np.concatenate([begin.coefficients[: self._fixed], free])

    def _negative_d(self, coefficients: FloatArray) -> tuple[float, FloatArray]:
        """-D and its derivative by the variables, shape (m,)."""
        value, *gradients = self._criteria.negative_d(*self._constraints.motion(coefficients))
        total = sum((f.T @ g for f, g in zip(self._constraints.functions, gradients, strict=True)), np.zeros(coefficients.shape))
        return value, (total * self._unit)[self._fixed :].ravel()

    def _correction(self, begin: FourierTrajectory, stage: Stage) -> FloatArray:
        """What the smooth maxima of a motion exceed the true ones by, shape (m,)."""
        smooth, _ = self._constraints.evaluate(begin.coefficients, stage.sharpness)
        if not stage.exact:
            return np.zeros(len(smooth))
        return smooth - self._constraints.exact(self._feasibility.use(begin, _EXACT_STEP))
