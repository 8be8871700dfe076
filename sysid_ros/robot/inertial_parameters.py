"""The ten inertial parameters of a rigid body: names, order, units, every conversion between their forms, and the nearest body.

Order (pinocchio's): m, mc_x, mc_y, mc_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz, the inertia about the *frame's origin*.
``geometry_msgs/Inertia`` and the node's messages hold another order and the inertia about the *centre of mass*; only this file
converts.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sysid_ros.sample import FloatArray

NAMES = ("m", "mc_x", "mc_y", "mc_z", "I_xx", "I_xy", "I_yy", "I_xz", "I_yz", "I_zz")
UNITS = ("kg",) + ("kg m",) * 3 + ("kg m^2",) * 6
MESSAGE_NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
TO_MESSAGE_ORDER = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])
"""Index that takes a vector in pinocchio's order to the order of the messages, and back (it is its own inverse)."""

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}
_SMALLEST = 1e-9
_FARTHEST = 0.5  # m, of the centre of mass from which the search begins
_RADIUS = 0.05  # m, of gyration of the body from which the search begins
_ITERATIONS = 60
TENSOR = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


def inertia_matrix(theta: FloatArray) -> FloatArray:
    """Inertia about the frame's origin, shape (3, 3) [kg m^2], from theta of shape (10,)."""
    xx, xy, yy, xz, yz, zz = theta[4:10]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def from_com(mass: float, com: FloatArray, inertia_com: FloatArray) -> FloatArray:
    """Theta of shape (10,) from the mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2] (parallel-axis
    theorem)."""
    com = np.asarray(com, dtype=float)
    origin = np.asarray(inertia_com, dtype=float) + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.concatenate(([mass], mass * com, [origin[i, j] for i, j in TENSOR]))


def to_com(theta: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2]; com and inertia are NaN where the mass is zero."""
    mass = float(theta[0])
    if mass == 0.0:
        return 0.0, np.full(3, np.nan), np.full((3, 3), np.nan)
    com = theta[1:4] / mass
    return mass, com, inertia_matrix(theta) - mass * (com @ com * np.eye(3) - np.outer(com, com))


def com_jacobian(theta: FloatArray) -> FloatArray:
    """Derivative of the centre of mass by theta, shape (3, 10) [m per unit], for the delta method."""
    jacobian = np.zeros((3, 10))
    jacobian[:, 0] = -theta[1:4] / theta[0] ** 2
    jacobian[:, 1:4] = np.eye(3) / theta[0]
    return jacobian


def pseudo_inertia(theta: FloatArray) -> FloatArray:
    """Pseudo-inertia, shape (4, 4): [[Sigma, mc], [mc', m]] with Sigma = tr(I)/2 1 - I (Wensing, Kim, Slotine 2018, section
    III)."""
    inertia = inertia_matrix(theta)
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = theta[1:4]
    out[3, 3] = theta[0]
    return out


def from_pseudo_inertia(matrix: FloatArray) -> FloatArray:
    """Theta of shape (10,) from a pseudo-inertia of shape (4, 4)."""
    sigma = matrix[:3, :3]
    inertia = np.trace(sigma) * np.eye(3) - sigma
    return np.concatenate(([matrix[3, 3]], matrix[:3, 3], [inertia[i, j] for i, j in TENSOR]))


def is_physical(theta: FloatArray) -> bool:
    """True where some body of positive density has these parameters: the pseudo-inertia is positive definite."""
    try:
        np.linalg.cholesky(pseudo_inertia(theta))
    except np.linalg.LinAlgError:
        return False
    return True


def move(theta: FloatArray, rotation: FloatArray, translation: FloatArray) -> FloatArray:
    """Theta of the same body seen from another frame.

    Args:
        theta: shape (10,), in frame B.
        rotation: shape (3, 3), takes vectors from B to A.
        translation: shape (3,) [m], origin of B in A.
    """
    homogeneous = np.eye(4)
    homogeneous[:3, :3], homogeneous[:3, 3] = rotation, translation
    return from_pseudo_inertia(homogeneous @ pseudo_inertia(theta) @ homogeneous.T)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def body_of(theta: FloatArray, covariance: FloatArray) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """As :func:`to_com`, and the covariance of the centre of mass by :func:`com_jacobian`, shape (3, 3) [m^2]; infinite variance
    where the mass is zero. Compiled for the loop of the estimation."""
    mass, com, inertia, spread = theta[0], np.full(3, np.nan), np.full((3, 3), np.nan), np.zeros((3, 3))
    for i in range(3):
        spread[i, i] = np.inf
    if mass == 0.0:
        return 0.0, com, inertia, spread
    square = 0.0
    for i in range(3):
        com[i] = theta[1 + i] / mass
        square += com[i] * com[i]
    for i in range(3):
        for j in range(i + 1):
            # the six of the tensor stand as in TENSOR
            inertia[i, j] = theta[4 + i * (i + 1) // 2 + j] + mass * com[i] * com[j]
            inertia[i, i] -= mass * square if i == j else 0.0
            inertia[j, i] = inertia[i, j]
        for j in range(3):
            rest = covariance[1 + i, 1 + j] - com[i] * covariance[0, 1 + j] - com[j] * covariance[1 + i, 0]
            spread[i, j] = (rest + com[i] * com[j] * covariance[0, 0]) / (mass * mass)
    return mass, com, inertia, spread


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
    """As :func:`is_physical`; L is overwritten."""
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
def project_into(theta: FloatArray, covariance: FloatArray, out: FloatArray) -> float:
    """As :func:`project`, for the loop of the estimation: the distance. The body goes to ``out``, shape (10,), unless
    ``theta`` is one itself or there is no metric."""
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
    squared = float(project_into(np.ascontiguousarray(theta), np.ascontiguousarray(covariance), out))
    return (out if squared > 0.0 else theta), squared


def by_centre(body: FloatArray) -> FloatArray:
    """Derivative of a body's ten parameters (10,) by its centre of mass, shape (10, 3), the inertia about that as it is."""
    out = np.zeros((10, 3))
    out[1:4] = body[0] * np.eye(3)
    for k, axis in enumerate(np.eye(3)):
        both = np.outer(axis, body[1:4])
        change = 2.0 * body[1 + k] * np.eye(3) - both - both.T
        out[4:, k] = [change[i, j] for i, j in TENSOR]
    return out
