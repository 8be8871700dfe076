"""Compiled inner loops of the contact projection. Arrays are changed in place."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}

DAMPING = 1e-3
"""Lever below which the force along a leg is not read from its torques [m]."""
_NORMAL_TIME = 0.1
"""Time in which the normal of the ground follows the feet [s]."""
_FORCE_TIME = 0.02
"""Time constant of the forces from which the stance is inferred [s]."""
_LOADED, _UNLOADED = 0.06, 0.03
"""Share of the weight above which a foot is taken to stand, and below which to have left the ground."""
_CARRIED = 0.15
"""Share of the weight that the feet carry at least where rows are used."""
_STRETCHED = 0.01
"""Lever of the torques about the force along a leg, its least singular value, below which the force is not read from them [m]."""
_SLIP = 0.15
"""Velocity between feet that stand above which one of them slips [m/s]."""


@njit(**_JIT)  # type: ignore[untyped-decorator]
def turn_direction(normal: FloatArray, omega: FloatArray, dt: float) -> None:
    """A direction that rests in the world, seen from the trunk that turns: ``dn/dt = n x w``."""
    x, y, z = normal[0], normal[1], normal[2]
    normal[0] += dt * (y * omega[2] - z * omega[1])
    normal[1] += dt * (z * omega[0] - x * omega[2])
    normal[2] += dt * (x * omega[1] - y * omega[0])


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _follow_feet(normal: FloatArray, origins: FloatArray, stands: NDArray[np.bool_], gain: float) -> None:
    """Make the normal more perpendicular to the lines between feet that stand."""
    step = np.zeros(3)
    pairs = 0
    for i in range(origins.shape[0]):
        for j in range(i):
            if not (stands[i] and stands[j]):
                continue
            line = origins[i] - origins[j]
            length = line[0] * line[0] + line[1] * line[1] + line[2] * line[2]
            if length < 1e-4:
                continue
            along = (normal[0] * line[0] + normal[1] * line[1] + normal[2] * line[2]) / length
            for a in range(3):
                step[a] += along * line[a]
            pairs += 1
    total = 0.0
    for a in range(3):
        if pairs:
            normal[a] -= gain * step[a] * min(1.0, 2.0 / pairs)
        total += normal[a] * normal[a]
    total = np.sqrt(total)
    for a in range(3):
        normal[a] /= total


@njit(**_JIT)  # type: ignore[untyped-decorator]
def touching(
    origins: FloatArray,
    motions: FloatArray,
    carriers: NDArray[np.bool_],
    radius: FloatArray,
    normal: FloatArray,
    out: FloatArray,
) -> None:
    """Jacobians (k, 3, n) of the points ``centre - r n``."""
    for i in range(origins.shape[0]):
        x, y, z = (
            origins[i, 0] - radius[i] * normal[0],
            origins[i, 1] - radius[i] * normal[1],
            origins[i, 2] - radius[i] * normal[2],
        )
        for j in range(motions.shape[1]):
            if not carriers[i, j]:
                continue
            wx, wy, wz = motions[3, j], motions[4, j], motions[5, j]
            out[i, 0, j] = motions[0, j] + wy * z - wz * y
            out[i, 1, j] = motions[1, j] + wz * x - wx * z
            out[i, 2, j] = motions[2, j] + wx * y - wy * x


@njit(**_JIT)  # type: ignore[untyped-decorator]
def project(points: FloatArray, rest: FloatArray, damping: float, matrix: FloatArray, forces: FloatArray) -> None:
    """``A = -J_b' G^-1 J_l`` into ``matrix`` (6, n - 6) and ``f = -G^-1 J_l rest_l`` into ``forces`` (k, 3), with
    ``G = J_l J_l' + damping^2``; all by one Cholesky factor."""
    k, n = points.shape[0], points.shape[2]
    rows, legs = 3 * k, n - 6
    J = points.reshape(rows, n)
    L = np.zeros((rows, rows))
    for i in range(rows):
        for j in range(i + 1):
            total = damping * damping if i == j else 0.0
            for c in range(legs):
                total += J[i, 6 + c] * J[j, 6 + c]
            for c in range(j):
                total -= L[i, c] * L[j, c]
            L[i, j] = np.sqrt(total) if i == j else total / L[j, j]
    right = np.zeros((rows, 7))
    for i in range(rows):
        for c in range(6):
            right[i, c] = J[i, c]
        for c in range(legs):
            right[i, 6] += J[i, 6 + c] * rest[6 + c]
    for c in range(7):
        for i in range(rows):
            total = right[i, c]
            for j in range(i):
                total -= L[i, j] * right[j, c]
            right[i, c] = total / L[i, i]
        for i in range(rows - 1, -1, -1):
            total = right[i, c]
            for j in range(i + 1, rows):
                total -= L[j, i] * right[j, c]
            right[i, c] = total / L[i, i]
    for a in range(6):
        for c in range(legs):
            total = 0.0
            for i in range(rows):
                total -= right[i, a] * J[i, 6 + c]
            matrix[a, c] = total
    for i in range(k):
        for a in range(3):
            forces[i, a] = -right[3 * i + a, 6]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def multiply(matrix: FloatArray, rows: FloatArray, out: FloatArray) -> None:
    """``out = [1, matrix] rows``: (6, n - 6), (n, c) -> (6, c)."""
    for i in range(matrix.shape[0]):
        for c in range(rows.shape[1]):
            total = rows[i, c]
            for j in range(matrix.shape[1]):
                total += matrix[i, j] * rows[6 + j, c]
            out[i, c] = total


@njit(**_JIT)  # type: ignore[untyped-decorator]
def decorrelate(
    matrix: FloatArray, joint_variance: FloatArray, row_variance: FloatArray, factor: FloatArray, variance: FloatArray
) -> None:
    """``L D L' = A diag(joint_variance) A' + diag(row_variance)`` with ones on the diagonal of L, into ``factor`` (6, 6) and, of
    D, ``variance`` (6,)."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            total = row_variance[i] if i == j else 0.0
            for c in range(matrix.shape[1]):
                total += matrix[i, c] * matrix[j, c] * joint_variance[c]
            for k in range(j):
                total -= factor[i, k] * factor[j, k] * variance[k]
            if i == j:
                variance[i], factor[i, i] = total, 1.0
            else:
                factor[i, j], factor[j, i] = total / variance[j], 0.0


@njit(**_JIT)  # type: ignore[untyped-decorator]
def solve_unit_lower(factor: FloatArray, rows: FloatArray) -> None:
    """``rows <- L^-1 rows`` in place, (6, c)."""
    for i in range(rows.shape[0]):
        for k in range(i):
            for c in range(rows.shape[1]):
                rows[i, c] -= factor[i, k] * rows[k, c]


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _slide(points: FloatArray, v: FloatArray, stands: NDArray[np.bool_]) -> float:
    """Largest velocity between two feet that stand [m/s]: over firm ground all move alike against the trunk."""
    k, n = points.shape[0], points.shape[2]
    velocities = np.zeros((k, 3))
    for i in range(k):
        for a in range(3):
            for j in range(n):
                velocities[i, a] += points[i, a, j] * v[j]
    largest = 0.0
    for i in range(k):
        for j in range(i):
            if stands[i] and stands[j]:
                total = 0.0
                for a in range(3):
                    total += (velocities[i, a] - velocities[j, a]) ** 2
                largest = max(largest, np.sqrt(total))
    return largest


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _is_stretched(point: FloatArray) -> bool:
    """Whether a force on a point of the Jacobian (3, n) can be held without torques: the least eigenvalue of ``J_l J_l'``, small
    beside the others, is about its determinant over the sum of its principal minors of order two."""
    G = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            for j in range(6, point.shape[1]):
                G[a, b] += point[a, j] * point[b, j]
    x, y, z = G[1, 1] * G[2, 2] - G[1, 2] ** 2, G[0, 0] * G[2, 2] - G[0, 2] ** 2, G[0, 0] * G[1, 1] - G[0, 1] ** 2
    cofactor_y, cofactor_z = G[1, 0] * G[2, 2] - G[1, 2] * G[2, 0], G[1, 0] * G[2, 1] - G[1, 1] * G[2, 0]
    determinant = G[0, 0] * x - G[0, 1] * cofactor_y + G[0, 2] * cofactor_z
    return bool(determinant < _STRETCHED * _STRETCHED * (x + y + z))


@njit(**_JIT)  # type: ignore[untyped-decorator]
def follow(
    origins: FloatArray,
    motions: FloatArray,
    carriers: NDArray[np.bool_],
    radius: FloatArray,
    v: FloatArray,
    a: FloatArray,
    rest: FloatArray,
    reported: FloatArray,
    dt: float,
    fresh: bool,
    weight: float,
    points: FloatArray,
    matrix: FloatArray,
    forces: FloatArray,
    normal: FloatArray,
    loaded: NDArray[np.bool_],
    stands: NDArray[np.bool_],
    smooth: FloatArray,
) -> tuple[bool, bool, bool]:
    """Normal, basis, forces and stance of a sample, into the arrays from ``points`` on; whether the rows may be used, whether a
    foot slips, and whether a leg is stretched whose foot is not reported in the air."""
    k = origins.shape[0]
    if fresh:
        size = max(np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]), 1e-9)
        for c in range(3):
            normal[c] = a[c] / size
        loaded[:] = True
    turn_direction(normal, v[3:6], dt)
    for i in range(k):
        stands[i] = loaded[i] and (reported.size == 0 or reported[i] > 0.5)
    for _ in range(50 if fresh else 1):
        _follow_feet(normal, origins, stands, 0.3 if fresh else min(dt / _NORMAL_TIME, 0.5))
    touching(origins, motions, carriers, radius, normal, points)
    project(points, rest, DAMPING, matrix, forces)
    share = 1.0 if fresh else min(dt / _FORCE_TIME, 1.0)
    carried = 0.0
    anybody = False
    for i in range(k):
        along = forces[i, 0] * normal[0] + forces[i, 1] * normal[1] + forces[i, 2] * normal[2]
        smooth[i] += share * (along - smooth[i])
        loaded[i] = smooth[i] > weight * (_UNLOADED if loaded[i] else _LOADED)
        stands[i] = loaded[i] if reported.size == 0 else reported[i] > 0.5
        carried += smooth[i]
        anybody = anybody or stands[i]
    slips = _slide(points, v, stands & loaded) > _SLIP
    stretched = False
    for i in range(k):
        if reported.size == 0 or reported[i] > 0.5:
            stretched = stretched or _is_stretched(points[i])
    return anybody and carried > _CARRIED * weight and not stretched, slips, stretched
