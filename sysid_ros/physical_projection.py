"""The physical body nearest to an estimate, in the metric of the estimate's own covariance."""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros import inertial_parameters
from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}
_SMALLEST = 1e-9


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _theta_of(matrix: FloatArray, out: FloatArray) -> None:
    trace = matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    out[0] = matrix[3, 3]
    out[1], out[2], out[3] = matrix[0, 3], matrix[1, 3], matrix[2, 3]
    out[4], out[5], out[6] = trace - matrix[0, 0], -matrix[0, 1], trace - matrix[1, 1]
    out[7], out[8], out[9] = -matrix[0, 2], -matrix[1, 2], trace - matrix[2, 2]


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
    _theta_of(upper @ upper.T + _SMALLEST * np.eye(4), theta)
    column = np.empty(10)
    k = 0
    for i in range(4):
        for j in range(i, 4):
            step = upper[i, j] if i == j else 1.0
            product = np.zeros((4, 4))
            for a in range(4):
                product[i, a] += step * upper[a, j]
                product[a, i] += step * upper[a, j]
            _theta_of(product, column)
            jacobian[:, k] = column
            k += 1


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _levenberg_marquardt(target: FloatArray, root: FloatArray, phi: FloatArray, iterations: int) -> float:
    """Minimise |root (theta(phi) - target)|^2 from ``phi``, changed in place; the minimum."""
    theta, jacobian = np.empty(10), np.empty((10, 10))
    _model(phi, theta, jacobian)
    residual = root @ (theta - target)
    cost = residual @ residual
    damping = 1e-3
    for _ in range(iterations):
        J = root @ jacobian
        normal = J.T @ J
        gradient = J.T @ residual
        improved = False
        for _ in range(12):
            damped = normal.copy()
            for i in range(10):
                damped[i, i] += damping * (normal[i, i] + 1e-9)
            step = np.linalg.solve(damped, gradient)
            for i in range(10):
                step[i] = min(max(step[i], -2.0), 2.0)
            _model(phi - step, theta, jacobian)
            trial = root @ (theta - target)
            trial_cost = trial @ trial
            if trial_cost < cost:
                improved = True
                break
            damping *= 4.0
        if not improved:
            break
        phi -= step
        gain = cost - trial_cost
        residual, cost = trial, trial_cost
        damping = max(damping * 0.2, 1e-9)
        if gain < 1e-6 * (1e-3 + cost):
            break
    return float(cost)


def project(theta: FloatArray, covariance: FloatArray) -> tuple[FloatArray, float]:
    """The physical parameters nearest to ``theta``, and the squared Mahalanobis distance to them.

    Minimises ``(x - theta)' P^-1 (x - theta)`` over the bodies whose pseudo-inertia is positive definite, in log-Cholesky
    coordinates (Rucker, Wensing 2022). Under a correct covariance the distance is at most a chi-squared of 10 degrees of freedom.

    Args:
        theta: shape (10,). covariance: shape (10, 10), positive definite.
    Where theta is not finite or the covariance not positive definite there is no metric: theta comes back, the distance is NaN.
    """
    if not (np.isfinite(theta).all() and np.isfinite(covariance).all()):
        return theta, float("nan")
    if inertial_parameters.is_physical(theta):
        return theta, 0.0
    try:
        root = np.ascontiguousarray(np.linalg.cholesky(np.linalg.inv(covariance)).T)
    except np.linalg.LinAlgError:
        return theta, float("nan")
    mass = max(float(theta[0]), float(np.sqrt(covariance[0, 0])), 1e-3)
    com = np.clip(theta[1:4] / mass, -0.5, 0.5)
    start = inertial_parameters.pseudo_inertia(inertial_parameters.from_com(mass, com, mass * 0.0025 * np.eye(3)))
    flip = np.linalg.cholesky(start[::-1, ::-1])[::-1, ::-1]
    phi = np.array([np.log(flip[i, i]) if i == j else flip[i, j] for i in range(4) for j in range(i, 4)])
    cost = _levenberg_marquardt(np.ascontiguousarray(theta), root, phi, 60)
    projected = np.empty(10)
    _model(phi, projected, np.empty((10, 10)))
    return projected, float(cost)
