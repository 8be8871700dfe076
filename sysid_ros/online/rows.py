"""Rows: what the front end gives to the estimator."""

from __future__ import annotations

from typing import NamedTuple

from sysid_ros.estimators.estimator import Noise
from sysid_ros.sample import FloatArray


class Rows(NamedTuple):
    """``y = Y theta + noise`` after the low-pass, one row a joint.

    Attributes:
        Y: columns of the free effects, shape (n, p).
        y: torque left for them, shape (n,) [N m].
        speed: absolute joint velocities, shape (n,) [rad/s].
        slow: part of the row from when the joint hardly moved, where dry friction is not what a model says, shape (n,), 0 to 1.
        acceleration: shape (n,) [rad/s^2].
        tau: measured torque, shape (n,) [N m].
        considered: torque of the errors of what is known, shape (n, c) [N m], see :class:`.known_effect.KnownError`.
        t: of the newest sample that went in [s]. q, v: its positions and velocities, not filtered, shape (n,).
        fresh: True where the low-pass has not been filled for long, as after a change.
        noise: what the noise of the accelerations has done to Y, y and considered, as of :meth:`.Estimator.compensate`;
            not of each row.
        trust: part of the row from when the feet of a floating base carried it, 0 to 1; 1 on an arm.
    """

    Y: FloatArray
    y: FloatArray
    speed: FloatArray
    slow: FloatArray
    acceleration: FloatArray
    tau: FloatArray
    considered: FloatArray
    t: float
    q: FloatArray
    v: FloatArray
    trust: float = 1.0
    noise: Noise = None
    fresh: bool = False
