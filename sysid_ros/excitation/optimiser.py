"""MotionOptimiser: the way from a motion to a local optimum, by gradients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sysid_ros.excitation.constraints import MotionConstraints
from sysid_ros.excitation.criteria import ExcitationCriteria
from sysid_ros.excitation.feasibility import Feasibility
from sysid_ros.excitation.fourier_trajectory import FourierBasis, FourierTrajectory
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

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


class MotionOptimiser:
    """Maximises ``D(C)`` under the smooth limits ``g(C) <= 1``, C the coefficients of a Fourier series.

    Sequential quadratic programming (scipy's SLSQP; Kraft 1988), in units of what the limits of each joint allow. It may stop
    anywhere; of all iterates the one is returned that would be best once it is shrunk to the limits.

    Args:
        criteria: what is maximised. feasibility: the limits.
        basis: of the motions. Where it is anchored, the posture of the first row stays.
    """

    def __init__(self, criteria: ExcitationCriteria, feasibility: Feasibility, basis: FourierBasis) -> None:
        self._criteria, self._feasibility, self._basis = criteria, feasibility, basis
        self._constraints = MotionConstraints(feasibility, basis, max(_LEAST_SAMPLES, _SAMPLES_PER_HARMONIC * basis.harmonics))
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
