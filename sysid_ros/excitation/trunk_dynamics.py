"""TrunkDynamics: what a trunk that moves over its feet asks of feet and joints, and how that changes with its motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.floating import contact_kernels as kernels
from sysid_ros.floating.planted_feet import PlacedFeet, PlantedFeet, States
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.signals.motion import Motion
from sysid_ros.torque.torque_model import TorqueModel

STEPS = (1e-6, 1e-6, 1e-3)
"""Differences of pose, velocity and acceleration over which derivatives are taken: rows are affine in the last."""


@dataclass(frozen=True, slots=True)
class TrunkPoses:
    """N poses of the trunk over its feet.

    Attributes:
        placed: the posture of the whole robot. matrix: A of :class:`.ContactProjection`, shape (N, 6, n - 6).
        shared: what each foot gives for a wrench on the trunk, shape (N, 3 k, 6). to_legs: torques for forces, shape
            (N, n - 6, 3 k).
    """

    placed: PlacedFeet
    matrix: FloatArray
    shared: FloatArray
    to_legs: FloatArray


@dataclass(frozen=True, slots=True)
class TrunkStates:
    """N states of the trunk over its feet.

    Attributes:
        poses: what does not depend on velocities. motion: q, v and a of the whole robot, shape (N, n) each.
        up, side: of the force of the ground on each foot, along the normal and across it, shape (N, k) [N].
        torque: of the joints, shape (N, n - 6) [N m].
    """

    poses: TrunkPoses
    motion: States
    up: FloatArray
    side: FloatArray
    torque: FloatArray


class TrunkDynamics:
    """Inverse dynamics of a robot on its feet, with the least forces that carry it.

    Of all forces with the wrench ``rnea_b = sum J_b' f`` the smallest, ``f = J_b (J_b' J_b)^-1 rnea_b``: where these are within
    the friction cones, the motion is feasible. Joints give ``tau = rnea_l - sum J_l' f``, with the description's friction.

    Args:
        feet: the robot and where it stands.
    """

    def __init__(self, feet: PlantedFeet) -> None:
        self.feet, self.base = feet, feet.base
        self._model = TorqueModel(self.base.robot, [])
        self._last: tuple[bytes, TrunkStates, list[list[TrunkStates]] | None] = (b"", None, None)  # type: ignore[assignment]

    def poses(self, q: FloatArray, near: FloatArray | None = None) -> TrunkPoses:
        """At poses of the trunk, shape (N, 6); ``near``: see :meth:`.PlantedFeet.joints`."""
        placed = self.feet.placed(q, near)
        count, k, n = len(q), len(self.feet.legs), self.base.robot.n
        matrix, unused, nothing = np.empty((count, FREE, n - FREE)), np.empty((k, 3)), np.zeros(n)
        for points, A in zip(placed.points, matrix, strict=True):
            kernels.project(points, nothing, kernels.DAMPING, A, unused)
        J = placed.points.reshape(count, 3 * k, n)
        of_trunk = J[:, :, :FREE]
        shared = of_trunk @ np.linalg.inv(np.swapaxes(of_trunk, 1, 2) @ of_trunk)
        return TrunkPoses(placed, matrix, shared, np.swapaxes(J[:, :, FREE:], 1, 2))

    def along(self, poses: TrunkPoses, v: FloatArray, a: FloatArray) -> TrunkStates:
        """At poses and their derivatives by time, shape (N, 6) each."""
        motion = self.feet.states(poses.placed, v, a)
        t = np.arange(len(v), dtype=float)
        wrench = self._model.torque_along(Motion(self.base.robot, t, *motion, np.zeros_like(motion[0])))
        forces = (poses.shared @ wrench[:, :FREE, None])[:, :, 0]
        torque = wrench[:, FREE:] - (poses.to_legs @ forces[:, :, None])[:, :, 0]
        each = forces.reshape(len(v), -1, 3)
        up = np.einsum("mki,mi->mk", each, poses.placed.normal)
        across = each - up[:, :, None] * poses.placed.normal[:, None]
        return TrunkStates(poses, motion, up, np.linalg.norm(across, axis=2), torque)

    def of(self, q: FloatArray, v: FloatArray, a: FloatArray) -> TrunkStates:
        """At poses of the trunk and their derivatives, shape (N, 6) each."""
        return self.along(self.poses(q), v, a)

    def at(self, q: FloatArray, v: FloatArray, a: FloatArray) -> TrunkStates:
        """:meth:`of`, the last of which is kept."""
        key = np.stack([q, v, a]).tobytes()
        if self._last[0] != key:
            self._last = key, self.of(q, v, a), None
        return self._last[1]

    def moved(self, q: FloatArray, v: FloatArray, a: FloatArray) -> list[list[TrunkStates]]:
        """The states with pose, velocity and acceleration moved by :data:`STEPS` along each of six, 3 lists of 6."""
        here, known = self.at(q, v, a), self._last[2]
        if known is None:
            near, each = here.poses.placed.over_ground[:, FREE:], np.eye(FREE)
            known = [
                [self.along(self.poses(q + STEPS[0] * x, near), v, a) for x in each],
                [self.along(here.poses, v + STEPS[1] * x, a) for x in each],
                [self.along(here.poses, v, a + STEPS[2] * x) for x in each],
            ]
            self._last = (*self._last[:2], known)
        return known
