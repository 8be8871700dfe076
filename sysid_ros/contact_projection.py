"""ContactProjection: the one step that a floating base adds, rows free of the forces on the feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sysid_ros.floating_base import FREE, FloatingBase
from sysid_ros.sample import FloatArray, Sample

_JIT = {"cache": True, "error_model": "numpy", "nogil": True}

_DAMPING = 1e-3
"""Lever below which the force along a leg is not read from its torques [m]."""
_NORMAL_TIME = 0.1
"""Time in which the normal of the ground follows the feet [s]."""
_FORCE_TIME = 0.02
"""Time constant of the forces from which the stance is inferred [s]."""
_LOADED, _UNLOADED = 0.06, 0.03
"""Share of the weight above which a foot is taken to stand, and below which to have left the ground."""
_CARRIED = 0.15
"""Share of the weight that the feet carry at least where rows are used."""
_SLIP = 0.15
"""Velocity between feet that stand above which one of them slips [m/s]."""
_G = 9.81


@dataclass(frozen=True, slots=True)
class Stance:
    """What the feet do at one sample.

    Attributes:
        stands: shape (k,), bool: told by the contact messages, else inferred.
        loaded: shape (k,), bool: inferred from the torques of the legs.
        forces: of the ground on the feet in the trunk's axes, without those of an unknown load on the legs, shape (k, 3) [N].
        normal: of the ground in the trunk's axes, shape (3,). trusted: the feet carry the robot and the rows may be used.
        slips: feet that stand move against each other.
    """

    stands: NDArray[np.bool_]
    loaded: NDArray[np.bool_]
    forces: FloatArray
    normal: FloatArray
    trusted: bool
    slips: bool


class ContactProjection:
    """Multiplies the rows of a floating base by a basis of the null space of the contact Jacobian of *all* feet.

    With J_b (3k, 6) and J_l (3k, n - 6) the parts of the contact Jacobian for trunk and legs, ``N' = [1, A]`` with
    ``A = -J_b' (J_l J_l')^-1 J_l`` fulfils ``N' J' = 0``, so of ``rnea = [0; tau] + J' f`` six rows are left, the balance of
    force and moment on the whole robot with the forces on the feet read from the torques of the legs::

        N' rnea(q, v, a) = A tau

    A foot in the air has no force, so to eliminate it as well costs nothing but the noise of its leg, and nothing needs to
    switch when feet land or lift: the basis is a smooth function of q, and the rows may pass a filter across a step, an impact
    or a slip. A wrong contact flag does no harm. (A basis for the feet that are told to stand would jump at each step, and leaves
    the force of a foot in the equation that lands before its flag does.)

    The force acts where the foot touches: for a sphere of radius r at ``centre - r n``, with the normal n that is perpendicular
    to the lines between feet that stand, followed with the gyro in between.

    References: Aghili 2005 (projection by null space); Mistry, Schaal, Yamane 2009 (floating bases, section III).

    Args:
        base: the robot.
    """

    def __init__(self, base: FloatingBase) -> None:
        self.base = base
        k, n = len(base.contact_frames), base.robot.n
        self._radius = base.foot_radius
        self.matrix: FloatArray = np.zeros((FREE, n - FREE))
        self._points = np.zeros((k, 3, n))
        self._forces, self._smooth = np.zeros((k, 3)), np.zeros(k)
        self._normal = np.zeros(3)
        self._loaded = np.zeros(k, dtype=np.bool_)
        self._weight = base.mass * _G
        self._t = -np.inf

    def reset(self) -> None:
        """Forget normal and stance."""
        self._t = -np.inf

    def update(self, sample: Sample, rest: FloatArray, told: FloatArray | None) -> Stance:
        """Make the basis for a sample.

        Args:
            sample: of all n joints. rest: measured torque minus what is known, shape (n,). told: contacts, shape (k,), or None.
        """
        origins, jacobians = self.base.contacts.jacobians(sample.q)
        fresh = not 0.0 < sample.t - self._t < 0.5
        dt = 0.0 if fresh else sample.t - self._t
        self._t = sample.t
        if fresh:
            self._normal[:] = sample.a[:3] / max(float(np.linalg.norm(sample.a[:3])), 1e-9)
            self._loaded[:] = True
        stands = self._loaded.copy() if told is None else np.asarray(told) > 0.5
        _turn_normal(self._normal, sample.v[3:FREE], dt)
        for _ in range(50 if fresh else 1):
            _follow_feet(self._normal, origins, stands & self._loaded, 0.3 if fresh else min(dt / _NORMAL_TIME, 0.5))
        _touching(jacobians, self._radius, self._normal, self._points)
        _project(self._points, rest, _DAMPING, self.matrix, self._forces)
        along = self._forces @ self._normal
        share = 1.0 if fresh else min(dt / _FORCE_TIME, 1.0)
        self._smooth += share * (along - self._smooth)
        limit = self._weight * np.where(self._loaded, _UNLOADED, _LOADED)
        np.greater(self._smooth, limit, out=self._loaded)
        if told is None:
            stands = self._loaded.copy()
        carried = float(self._smooth.sum()) > _CARRIED * self._weight
        return Stance(
            stands=stands,
            loaded=self._loaded.copy(),
            forces=self._forces.copy(),
            normal=self._normal.copy(),
            trusted=bool(stands.any()) and carried,
            slips=_slide(self._points, sample.v, stands & self._loaded) > _SLIP,
        )

    def apply(self, rows: FloatArray, out: FloatArray) -> None:
        """``N' rows`` for rows of shape (n, c), into ``out`` of shape (6, c)."""
        _multiply(self.matrix, rows, out)


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _turn_normal(normal: FloatArray, omega: FloatArray, dt: float) -> None:
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
def _touching(jacobians: FloatArray, radius: FloatArray, normal: FloatArray, out: FloatArray) -> None:
    """Jacobians (k, 3, n) of the points ``centre - r n`` from those of the centres (k, 6, n)."""
    for i in range(jacobians.shape[0]):
        x, y, z = -radius[i] * normal[0], -radius[i] * normal[1], -radius[i] * normal[2]
        for j in range(jacobians.shape[2]):
            wx, wy, wz = jacobians[i, 3, j], jacobians[i, 4, j], jacobians[i, 5, j]
            out[i, 0, j] = jacobians[i, 0, j] + wy * z - wz * y
            out[i, 1, j] = jacobians[i, 1, j] + wz * x - wx * z
            out[i, 2, j] = jacobians[i, 2, j] + wx * y - wy * x


@njit(**_JIT)  # type: ignore[untyped-decorator]
def _project(points: FloatArray, rest: FloatArray, damping: float, matrix: FloatArray, forces: FloatArray) -> None:
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
def _multiply(matrix: FloatArray, rows: FloatArray, out: FloatArray) -> None:
    for i in range(matrix.shape[0]):
        for c in range(rows.shape[1]):
            total = rows[i, c]
            for j in range(matrix.shape[1]):
                total += matrix[i, j] * rows[6 + j, c]
            out[i, c] = total


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
