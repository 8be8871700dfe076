"""The physical body nearest to an estimate, in the metric of the estimate's own covariance."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}
_SMALLEST = 1e-9
_FARTHEST = 0.5  # m, of the centre of mass from which the search begins
_RADIUS = 0.05  # m, of gyration of the body from which the search begins
_ITERATIONS = 60


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _cholesky(matrix: FloatArray, L: FloatArray) -> bool:
    """Lower L with ``L L' = matrix``; False where it is not positive definite, or not finite."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if j < i:
                L[i, j] = total / L[j, j]
            elif not 0.0 < total < np.inf:
                return False
            else:
                L[i, i] = np.sqrt(total)
    return True


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _solve_lower(L: FloatArray, b: FloatArray) -> None:
    """``b <- L^-1 b``, column by column where b is a matrix of shape (n, c)."""
    for i in range(L.shape[0]):
        for c in range(b.shape[1]):
            for k in range(i):
                b[i, c] -= L[i, k] * b[k, c]
            b[i, c] /= L[i, i]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _theta_of(matrix: FloatArray, out: FloatArray) -> None:
    trace = matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    out[0] = matrix[3, 3]
    out[1], out[2], out[3] = matrix[0, 3], matrix[1, 3], matrix[2, 3]
    out[4], out[5], out[6] = trace - matrix[0, 0], -matrix[0, 1], trace - matrix[1, 1]
    out[7], out[8], out[9] = -matrix[0, 2], -matrix[1, 2], trace - matrix[2, 2]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _is_physical(theta: FloatArray, L: FloatArray) -> bool:
    """As :func:`sysid_ros.robot.inertial_parameters.is_physical`; L is overwritten."""
    half = 0.5 * (theta[4] + theta[6] + theta[9])
    matrix = np.empty((4, 4))
    matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[3, 3] = half - theta[4], half - theta[6], half - theta[9], theta[0]
    matrix[1, 0], matrix[2, 0], matrix[2, 1] = -theta[5], -theta[7], -theta[8]
    matrix[3, :3] = theta[1:4]
    return bool(_cholesky(matrix, L))


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _model(phi: FloatArray, theta: FloatArray, jacobian: FloatArray) -> None:
    """theta(phi) and its derivative (10, 10), for the pseudo-inertia U U' + eps 1 with U upper triangular, its diagonal
    exp(phi)."""
    upper = np.zeros((4, 4))
    k = 0
    for i in range(4):
        for j in range(i, 4):
            upper[i, j] = np.exp(phi[k]) if i == j else phi[k]
            k += 1
    product = np.zeros((4, 4))
    for i in range(4):
        product[i, i] = _SMALLEST
        for j in range(4):
            for k in range(max(i, j), 4):
                product[i, j] += upper[i, k] * upper[j, k]
    _theta_of(product, theta)
    column = np.empty(10)
    k = 0
    for i in range(4):
        for j in range(i, 4):
            step = upper[i, j] if i == j else 1.0
            product[:] = 0.0
            for a in range(4):
                product[i, a] += step * upper[a, j]
                product[a, i] += step * upper[a, j]
            _theta_of(product, column)
            jacobian[:, k] = column
            k += 1


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _levenberg_marquardt(target: FloatArray, L: FloatArray, phi: FloatArray, theta: FloatArray) -> float:
    """Minimise |L^-1 (theta(phi) - target)|^2 from ``phi``, changed in place as ``theta`` is; the minimum."""
    whitened = np.empty((10, 11))  # the derivative and, in the last column, the residual
    trial, step = np.empty((10, 11)), np.empty((10, 1))
    normal, damped, factor = np.empty((10, 10)), np.empty((10, 10)), np.empty((10, 10))
    gradient = np.empty(10)
    _model(phi, theta, whitened)
    whitened[:, 10] = theta - target
    _solve_lower(L, whitened)
    cost = np.sum(whitened[:, 10] ** 2)
    damping = 1e-3
    for _ in range(_ITERATIONS):
        for i in range(10):
            gradient[i] = np.sum(whitened[:, i] * whitened[:, 10])
            for j in range(i + 1):
                normal[i, j] = np.sum(whitened[:, i] * whitened[:, j])
        improved = False
        for _ in range(12):
            damped[:] = normal
            for i in range(10):
                damped[i, i] += damping * (normal[i, i] + 1e-9)
            if _cholesky(damped, factor):
                step[:, 0] = gradient
                _solve_lower(factor, step)
                for i in range(9, -1, -1):
                    for k in range(i + 1, 10):
                        step[i, 0] -= factor[k, i] * step[k, 0]
                    step[i, 0] /= factor[i, i]
                for i in range(10):
                    step[i, 0] = min(max(step[i, 0], -2.0), 2.0)
                _model(phi - step[:, 0], theta, trial)
                trial[:, 10] = theta - target
                _solve_lower(L, trial)
                trial_cost = np.sum(trial[:, 10] ** 2)
                if trial_cost < cost:
                    improved = True
                    break
            damping *= 4.0
        if not improved:
            break
        phi -= step[:, 0]
        gain = cost - trial_cost
        whitened, trial, cost = trial, whitened, trial_cost
        damping = max(damping * 0.2, 1e-9)
        if gain < 1e-6 * (1e-3 + cost):
            break
    _model(phi, theta, trial)
    return float(cost)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _project(theta: FloatArray, covariance: FloatArray, out: FloatArray) -> float:
    """As :func:`project`; the body is written to ``out``, shape (10,), unless ``theta`` is one itself or there is no metric."""
    L = np.zeros((10, 10))
    if not (np.isfinite(theta).all() and np.isfinite(covariance).all()):
        return np.nan
    if _is_physical(theta, L):
        return 0.0
    if not _cholesky(covariance, L):
        return np.nan
    mass = max(theta[0], np.sqrt(covariance[0, 0]), 1e-3)
    phi = np.zeros(10)  # a ball: U = [[r 1, com], [0, 1]] sqrt(mass)
    phi[0] = phi[4] = phi[7] = np.log(_RADIUS * np.sqrt(0.5 * mass))
    phi[9] = np.log(np.sqrt(mass))
    for k, i in ((3, 1), (6, 2), (8, 3)):
        phi[k] = np.sqrt(mass) * min(max(theta[i] / mass, -_FARTHEST), _FARTHEST)
    return float(_levenberg_marquardt(theta, L, phi, out))


def project(theta: FloatArray, covariance: FloatArray) -> tuple[FloatArray, float]:
    """The physical parameters nearest to ``theta``, and the squared Mahalanobis distance to them.

    Minimises ``(x - theta)' P^-1 (x - theta)`` over the bodies whose pseudo-inertia is positive definite, in log-Cholesky
    coordinates (Rucker, Wensing 2022). Under a correct covariance the distance is at most a chi-squared of 10 degrees of freedom.

    Args:
        theta: shape (10,). covariance: shape (10, 10), positive definite.
    Where theta is not finite or the covariance not positive definite there is no metric: theta comes back, the distance is NaN.
    """
    out = np.empty(10)
    squared = float(_project(np.ascontiguousarray(theta), np.ascontiguousarray(covariance), out))
    return (out if squared > 0.0 else theta), squared
