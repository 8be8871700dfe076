"""TrunkEffect: what is otherwise of IMU or feet of a robot on legs than it is said."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from sysid_ros.effects.effect import Acts, Effect
from sysid_ros.sample import FREE, FloatArray, Sample
from sysid_ros.signals.motion import Motion
from sysid_ros.signals.trunk_channels import TrunkSetup


class TrunkEffect(Effect):
    """An error of what is said of IMU and feet, to first order as torque on all joints of a floating base.

    Where it is known it is no torque: what the IMU shows is corrected by it (:meth:`as_setup`), exactly.

    Attributes:
        expected: standard deviation of each parameter before any data, where it is one that is wrong.
        always: the same of what no robot is free of.
    """

    acts = Acts.MEASUREMENT
    usual = 0.1
    on_legs = True
    expected: ClassVar[float]
    always: ClassVar[float]

    def prior_std(self, form: str = "") -> FloatArray:
        return np.full(self.p, self.expected)

    def usual_on_legs(self, torque: float) -> FloatArray | float:
        return self.always

    @abstractmethod
    def as_setup(self, theta: FloatArray) -> TrunkSetup: ...

    @abstractmethod
    def of_setup(self, setup: TrunkSetup) -> FloatArray: ...

    def fill(self, sample: Sample, out: FloatArray) -> None:
        """Nothing: it shows along a motion only, see :meth:`columns_along`."""


class PlacementEffect(TrunkEffect):
    """One that makes the IMU show another specific force: ``tau = M_b(q) ds(theta)``, with M_b (n, 3) the torque that a unit of
    specific force of the trunk costs."""

    @abstractmethod
    def force(self, w: FloatArray, dw: FloatArray, s: FloatArray) -> FloatArray:
        """ds by the parameters, shape (..., 3, p), for angular velocity, angular acceleration and specific force (..., 3)."""

    def fill(self, sample: Sample, out: FloatArray) -> None:
        if len(sample.q) <= FREE:
            return
        w, s = sample.v[3:FREE], sample.a[:3]
        dw = sample.a[3:FREE] + np.array([w[1] * w[2], -w[0] * w[2], w[0] * w[1]])
        out[:] = self.robot.base_acceleration_columns(sample.q) @ self.force(w, dw, s)

    def columns_along(self, motion: Motion) -> FloatArray:
        if motion.q.shape[1] <= FREE:
            return np.zeros((len(motion.t), self.robot.n, self.p))
        w, s = motion.v[:, 3:FREE], motion.a[:, :3]
        turns = np.stack([w[:, 1] * w[:, 2], -w[:, 0] * w[:, 2], w[:, 0] * w[:, 1]], axis=1)
        return motion.base_mass @ self.force(w, motion.a[:, 3:FREE] + turns, s)


def cross(x: FloatArray) -> FloatArray:
    """The matrix of ``x ×``, shape (..., 3, 3), for x of shape (..., 3)."""
    nothing = np.zeros(x.shape[:-1])
    rows = [[nothing, -x[..., 2], x[..., 1]], [x[..., 2], nothing, -x[..., 0]], [-x[..., 1], x[..., 0], nothing]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
