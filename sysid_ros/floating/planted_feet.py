"""PlantedFeet: which joint motions carry the trunk of a robot over feet that stay on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from sysid_ros.floating import contact_kernels as kernels
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.standing import leg_joints, standing_posture
from sysid_ros.sample import FREE, FloatArray

_ITERATIONS, _EXACT = 40, 1e-11
"""Steps of Newton's method, and the error at which it ends [m]."""
_DAMPING = 1e-4
"""Lever below which a leg does not follow [m]."""
_STEP = 0.3
"""Of a joint in an iteration, at most [rad]."""
_UP = np.array([0.0, 0.0, 1.0])


States = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, slots=True)
class PlacedFeet:
    """N postures of the whole robot with all feet on the ground.

    Attributes:
        over_ground: pose of the trunk and positions of the joints, shape (N, n). of_trunk, of_legs: Jacobians of the points that
            touch, of the pose, shape (N, k, 3, 6), and of each foot's own leg, shape (N, k, 3, 3), in the axes of the ground.
        normal: of the ground in the trunk's axes, shape (N, 3). points: Jacobians there, shape (N, k, 3, n).
        lever: of each leg, least singular value of its Jacobian, shape (N, k) [m]: 0 for one that is stretched.
        miss: by how much each foot is not where it stands, shape (N, k) [m]: 0 where the leg can reach it.
    """

    over_ground: FloatArray
    of_trunk: FloatArray
    of_legs: FloatArray
    normal: FloatArray
    points: FloatArray
    lever: FloatArray
    miss: FloatArray


class PlantedFeet:
    """A trunk that moves over feet that neither lift nor slide, on level ground.

    The pose of the trunk is ``x, y, z`` of its origin and three turns, one after the other about its own axes x, y, z, from
    where it stands: the first six joints of ``base.robot``. Feet are spheres that roll: the point that touches has no velocity::

        J_t(q) v_t + J_l(q) v_l = 0,      d/dt (v_centre + w x (-r n)) = 0,      centre = centre_0 + r (phi x n)

    with phi the turn of the lower leg from where it stands. The last is rolling as long as that turn keeps its axis; what it is
    off by otherwise is r times the square of an angle.

    Args:
        base: the robot. posture: of its legs where the trunk's pose is zero, shape (n - 6,) [rad]; None: a usual one.

    Attributes:
        legs: columns of each leg among the measured joints, shape (k, 3). posture: as given. height: of the trunk's origin over
            the feet [m]. feet: points that touch, in the axes of the trunk that stands, shape (k, 3) [m].

    Raises:
        RobotModelError: a leg has more or fewer than three joints.
    """

    def __init__(self, base: FloatingBase, posture: FloatArray | None = None) -> None:
        self.base = base
        self.legs = leg_joints(base)
        self.posture = standing_posture(base, self.legs) if posture is None else posture
        self._radius = base.foot_radius
        self._centres, self._standing_axes = np.empty((len(self.legs), 3)), np.empty((len(self.legs), 3, 3))
        self._centres, _ = base.contacts.origins(np.concatenate([np.zeros(FREE), self.posture]))
        self._standing_axes = base.contacts.axes()
        self.feet: FloatArray = self._centres - self._radius[:, None] * _UP
        self.height = float(-self.feet[:, 2].mean())

    def joints(self, pose: FloatArray, near: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Positions of the legs' joints, shape (N, n - 6) [rad], at poses (N, 6) of the trunk, from positions ``near`` (the
        standing ones), and by how much each foot misses its place, shape (N, k) [m]."""
        q = np.hstack([pose, np.tile(self.posture, (len(pose), 1)) if near is None else near])
        error = np.zeros((len(pose), len(self.legs), 3))
        for _ in range(_ITERATIONS):
            J, centres, axes = self._look(q)
            turn = Rotation.from_matrix((axes @ np.swapaxes(self._standing_axes, 1, 2)).reshape(-1, 3, 3)).as_rotvec()
            rolled = self._radius[:, None] * np.cross(turn.reshape(error.shape), _UP)
            error = self._centres + rolled - centres
            if np.abs(error).max() < _EXACT:
                break
            q[:, FREE + self.legs] += np.clip(_solved(self._of_legs(J), error), -_STEP, _STEP)
        return q[:, FREE:], np.linalg.norm(error, axis=2)

    def placed(self, pose: FloatArray, near: FloatArray | None = None) -> PlacedFeet:
        """What follows from poses of the trunk alone, shape (N, 6); ``near``: see :meth:`joints`."""
        positions, miss = self.joints(pose, near)
        q = np.hstack([pose, positions])
        J, _, _ = self._look(q)
        own = self._of_legs(J)
        normal = Rotation.from_euler("XYZ", pose[:, 3:]).inv().apply(np.tile(_UP, (len(pose), 1)))
        trunk = np.hstack([np.zeros_like(pose), positions])
        lever = np.linalg.svd(own, compute_uv=False)[:, :, -1].astype(np.float64)
        return PlacedFeet(q, J[:, :, :, :FREE], own, normal, self._touching(trunk, normal), lever, miss)

    def states(self, placed: PlacedFeet, velocity: FloatArray, acceleration: FloatArray) -> States:
        """q, v and a of the whole robot as :meth:`.FloatingBase.state` has them, shape (N, n) each, for derivatives of the pose,
        shape (N, 6) each."""
        q, own = placed.over_ground, placed.of_legs
        nothing = np.zeros((len(q), q.shape[1] - FREE))
        v, a = np.hstack([velocity, nothing]), np.hstack([acceleration, nothing])
        v[:, FREE + self.legs] = _solved(own, -np.einsum("mkin,mn->mki", placed.of_trunk, velocity))
        whole = np.array([self.base.contacts.whole_accelerations(*state) for state in zip(q, v, a, strict=True)])
        drift = whole[:, :, :3] - self._radius[:, None] * np.cross(whole[:, :, 3:], _UP)
        a[:, FREE + self.legs] = _solved(own, -drift)
        return _seen(q, v, a)

    def _look(self, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Jacobians of the points that touch (N, k, 3, n), centres (N, k, 3) and axes (N, k, 3, 3) of the feet, over ground."""
        contacts, count, k = self.base.contacts, len(q), len(self.legs)
        J, centres, axes = np.zeros((count, k, 3, q.shape[1])), np.empty((count, k, 3)), np.empty((count, k, 3, 3))
        for i, each in enumerate(q):
            centres[i], motions = contacts.origins(each)
            axes[i] = contacts.axes()
            kernels.touching(centres[i], motions, contacts.carriers, self._radius, _UP, J[i])
        return J, centres, axes

    def _touching(self, q: FloatArray, normal: FloatArray) -> FloatArray:
        """Jacobians of the points that touch, in the trunk's axes, shape (N, k, 3, n)."""
        contacts = self.base.contacts
        out = np.zeros((len(q), len(self.legs), 3, q.shape[1]))
        for each, up, J in zip(q, normal, out, strict=True):
            centres, motions = contacts.origins(each)
            kernels.touching(centres, motions, contacts.carriers, self._radius, up, J)
        return out

    def _of_legs(self, J: FloatArray) -> FloatArray:
        """Of Jacobians (N, k, 3, n) the columns of each foot's own leg, shape (N, k, 3, 3)."""
        return np.stack([J[:, i][:, :, FREE + leg] for i, leg in enumerate(self.legs)], axis=1)


def _solved(J: FloatArray, right: FloatArray) -> FloatArray:
    """``J^-1 right`` with damping, for J of shape (N, k, 3, 3) and right (N, k, 3)."""
    transposed = np.swapaxes(J, 2, 3)
    square = transposed @ J + _DAMPING**2 * np.eye(3)
    return np.asarray(np.linalg.solve(square, transposed @ right[..., None])[..., 0])


def _seen(q: FloatArray, v: FloatArray, a: FloatArray) -> States:
    """States over ground as an observer in the trunk and its IMU see them, shape (N, n) each."""
    y, z = q[:, 4], q[:, 5]
    zero, one = np.zeros_like(y), np.ones_like(y)
    last = np.column_stack([zero, zero, one])
    second = np.column_stack([np.sin(z), np.cos(z), zero])
    first = np.column_stack([np.cos(y) * np.cos(z), -np.cos(y) * np.sin(z), np.sin(y)])
    dx, dy, dz = (v[:, i, None] for i in (3, 4, 5))
    after = second * dy + last * dz
    w = first * dx + after
    dw = first * a[:, 3, None] + second * a[:, 4, None] + last * a[:, 5, None]
    dw -= dx * np.cross(after, first) + dy * np.cross(last * dz, second)
    force = Rotation.from_euler("XYZ", q[:, 3:FREE]).inv().apply(a[:, :3] + 9.81 * _UP)
    product = np.column_stack([w[:, 1] * w[:, 2], -w[:, 0] * w[:, 2], w[:, 0] * w[:, 1]])
    nothing = np.zeros((len(q), 3))
    return (
        np.hstack([nothing, nothing, q[:, FREE:]]),
        np.hstack([nothing, w, v[:, FREE:]]),
        np.hstack([force, dw - product, a[:, FREE:]]),
    )
