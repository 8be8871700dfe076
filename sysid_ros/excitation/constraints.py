"""MotionConstraints: all limits of a motion as a few smooth inequalities."""

from __future__ import annotations

import numpy as np

from sysid_ros.excitation.feasibility import Feasibility, Use
from sysid_ros.excitation.fourier_trajectory import FourierBasis
from sysid_ros.excitation.tolerances import TOLERANCES
from sysid_ros.sample import FloatArray

_NEGLIGIBLE = 1e-4


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
        value, weight = _smooth_max(np.concatenate([use, -use], axis=1), sharpness)
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
        value, weight = _smooth_max((1.0 - room / TOLERANCES.depth)[None], sharpness)
        value, weight = value[0], weight[0]
        gradient = np.zeros((room.shape[1], self.functions[0].shape[1], q.shape[1]))
        matters = (weight > _NEGLIGIBLE) & (value > 0.0)
        for k in np.flatnonzero(matters.any(axis=1)):
            self._collision.room(q[k])
            pairs = np.flatnonzero(matters[k])
            by_posture = -weight[k, pairs, None] / TOLERANCES.depth * self._collision.room_gradient(q[k], pairs.tolist())
            gradient[pairs] += self.functions[0][k][None, :, None] * by_posture[:, None, :]
        return value, gradient


def _smooth_max(values: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
    """Over the second axis of values of shape (c, N, n): the smooth maximum, shape (c, n), and its derivative, (c, N, n)."""
    top = values.max(axis=1, keepdims=True)
    parts = np.exp(sharpness * (values - top))
    total = parts.sum(axis=1, keepdims=True)
    return top[:, 0] + np.log(total[:, 0]) / sharpness, parts / total
