"""FeetAlong: the contact projection along a whole motion, with the rows of legs that are in the air beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from sysid_ros.floating.contact_projection import ContactProjection
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.sample import FREE, FloatArray, Sample
from sysid_ros.signals.zero_phase import SmoothMotion

STANDS = (0.12, 0.05, 0.025)
"""Share of the weight on a foot above which it touches the ground: about what unknown friction and rotors of the legs show of a
foot in the air; half of that where they are known from a first fit; and from a second."""
_SWITCHES = 0.05
"""Reported contacts that last less than half of this are noise [s]."""
_AGREE = 0.85
"""Part of the time that reported contacts must agree with the forces to be believed beside them."""


@dataclass(frozen=True, slots=True)
class FeetAlong:
    """``P rnea(q, v, a) = P [0; tau]`` with ``P = [1, A; 0, 1]``: six rows of the whole robot, free of the forces on its feet,
    and one of each joint, which holds while its foot is in the air.

    Attributes:
        matrix: A, shape (M, 6, n - 6). trusted: the feet carry the robot and the six rows may be used, shape (M,), bool.
        loaded: joints of legs whose foot may touch the ground, shape (M, n - 6), bool.
        by_radius: derivative of what stands on the left by the radius of each foot, shape (M, 6, k) [N/m], [N].
        forces: of the ground on the feet in the axes of the trunk, shape (M, k, 3) [N].
        drive: torques nearest to the measured ones with which the feet carry the robot of the URDF, shape (M, n) [N m]: what is
            measured without its noise, and without what the URDF does not know.
    """

    matrix: FloatArray
    trusted: NDArray[np.bool_]
    loaded: NDArray[np.bool_]
    by_radius: FloatArray
    forces: FloatArray
    drive: FloatArray

    @classmethod
    def of(
        cls,
        base: FloatingBase,
        motion: SmoothMotion,
        settles: float,
        radius: Mapping[str, float] | None = None,
        torque: FloatArray | None = None,
        reported: FloatArray | None = None,
        stands: float = STANDS[0],
    ) -> FeetAlong:
        """Along a smooth motion of all n joints.

        Args:
            base: the robot. settles: time around a contact in which the filter leaves something of it [s].
            radius: by how much farther below its frame a foot touches the ground than the description says, by its name [m].
            torque: of all joints as far as it is known, friction and rotors too, shape (M, n) [N m]; None: of the URDF's links.
            reported: 1.0 where a foot was reported to stand, shape (M, k); believed as far as the forces agree.
            stands: share of the weight on a foot above which it touches the ground.
        """
        projection = ContactProjection(base, np.array([(radius or {}).get(name, 0.0) for name in base.contact_frames]))
        count, k, n = len(motion.t), len(base.contact_frames), base.robot.n
        matrix, by_radius = np.empty((count, FREE, n - FREE)), np.empty((count, FREE, k))
        trusted, forces, size = np.zeros(count, dtype=np.bool_), np.empty((count, k, 3)), np.empty((count, k))
        rigid = base.robot.rnea_along(motion.q, motion.v, motion.a)
        rest = motion.tau - (rigid if torque is None else torque)
        for i in range(count):
            sample = Sample(float(motion.t[i]), motion.q[i], motion.v[i], motion.a[i], motion.tau[i])
            stance = projection.update(sample, rest[i], None)
            matrix[i], trusted[i], forces[i] = projection.matrix, stance.trusted, stance.forces
            size[i] = np.linalg.norm(stance.forces, axis=1)
            for foot in range(k):
                by_radius[i, :, foot] = projection.by_radius(rest[i], foot)
        period = float(motion.t[1] - motion.t[0])
        touches = size > stands * base.mass * 9.81
        if reported is not None:
            touches |= _believed(reported, touches, period)
        reach = max(1, round(settles / period))
        touches = ndimage.binary_dilation(touches, np.ones((2 * reach + 1, 1), dtype=bool))
        legs = base.contacts.carriers[:, FREE:]
        loaded = (touches.astype(float) @ legs.astype(float)) > 0.0
        return cls(matrix, trusted, loaded, by_radius, forces, balanced(matrix, motion.tau, rigid))

    def project(self, rows: FloatArray, where: slice = slice(None)) -> FloatArray:
        """``P rows`` for rows of shape (M, n, ...), the six of the whole robot zero where they may not be used."""
        out = np.array(rows)
        out[:, :FREE] += np.einsum("mij,mj...->mi...", self.matrix[where], rows[:, FREE:], optimize=True)
        out[~self.trusted[where], :FREE] = 0.0
        return out

    @property
    def unusable(self) -> FloatArray:
        """Part of each row that may not be used, shape (M, n): 1 where it may not, 10 where a foot may touch the
        ground, of whose force a little is much."""
        nothing = np.zeros((len(self.trusted), FREE)) + ~self.trusted[:, None]
        return np.hstack([nothing, 10.0 * self.loaded])


def balanced(matrix: FloatArray, tau: FloatArray, rigid: FloatArray) -> FloatArray:
    """The least change of torques tau (M, n) by which ``A tau_l = rigid_b + A rigid_l``, for A of shape (M, 6, n - 6)."""
    left = np.einsum("mij,mj->mi", matrix, tau[:, FREE:] - rigid[:, FREE:]) - rigid[:, :FREE]
    square = matrix @ np.swapaxes(matrix, 1, 2)
    square += 1e-9 * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(FREE)
    change = np.einsum("mij,mi->mj", matrix, np.linalg.solve(square, left[:, :, None])[:, :, 0])
    out = tau.copy()
    out[:, FREE:] -= change
    return out


def _believed(reported: FloatArray, touches: NDArray[np.bool_], period: float) -> NDArray[np.bool_]:
    """Contacts as they were reported, shape (M, k), without what is too short; none of a foot whose forces disagree."""
    usual = ndimage.uniform_filter1d(reported, max(1, round(_SWITCHES / period)), axis=0) > 0.5
    return np.asarray(usual & (np.mean(usual == touches, axis=0) > _AGREE))
