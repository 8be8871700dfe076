"""FloatingDerivative: measurements of legs and IMU to samples of all joints of a floating base."""

from __future__ import annotations

from collections import deque

import numpy as np

from sysid_ros.floating_base import FREE, FloatingBase
from sysid_ros.sample import FloatArray, Measurement, Sample
from sysid_ros.signals import CausalDerivative


class FloatingDerivative:
    """As :class:`CausalDerivative`, for a robot whose first six joints are those of its trunk.

    The angles of the trunk's turns are the integral of the gyro by the trapezoidal rule, so that their slope is the smoothed
    angular velocity and their second difference the centred difference of it, as raw as the accelerations of the legs, and all go
    through the same even grid. The specific force is moved from the IMU at ``p`` to the trunk's origin::

        s = f - dw x p - w x (w x p)

    Args:
        base: the robot. period, half_width, use_message_velocity: as of :class:`CausalDerivative`.
    """

    def __init__(self, base: FloatingBase, period: float, half_width: int, use_message_velocity: bool = False) -> None:
        self._base = base
        self._inner = CausalDerivative(base.robot.n, period, half_width, use_message_velocity)
        self._turned = np.zeros(3)
        self._last: tuple[float, FloatArray] | None = None
        self._place = np.zeros(3)
        self._told: deque[tuple[float, FloatArray | None]] = deque(maxlen=4 * half_width + 16)

    @property
    def filled(self) -> int:
        """As :attr:`CausalDerivative.filled`."""
        return self._inner.filled

    def push(self, measurement: Measurement) -> list[Sample]:
        """The samples that a measurement completes."""
        trunk = measurement.trunk
        if trunk is None:
            return []
        if self._last is not None:
            before, omega = self._last
            self._turned = self._turned + 0.5 * (measurement.t - before) * (omega + trunk.omega)
        self._last = measurement.t, trunk.omega
        self._place = trunk.place
        self._told.append((measurement.t, trunk.contacts))
        zero = np.zeros(3)
        q = np.concatenate((zero, self._turned, measurement.q))
        v = None if measurement.v is None else np.concatenate((zero, trunk.omega, measurement.v))
        # the specific force goes where a force of the trunk's slides would: through the same grid and the same delay
        tau = np.concatenate((trunk.force, zero, measurement.tau))
        return [self._of_all_joints(sample) for sample in self._inner.push(Measurement(measurement.t, q, v, tau))]

    def contacts(self, t: float) -> FloatArray | None:
        """Which feet were told to stand at t, shape (k,); None where no message told."""
        told = None
        for at, contacts in self._told:
            if at > t + 1e-9:
                break
            told = contacts
        return told

    def _of_all_joints(self, sample: Sample) -> Sample:
        omega, omega_dot, p = sample.v[3:FREE], sample.a[3:FREE], self._place
        force = sample.tau[:3]
        if p.any():
            force = force - _cross(omega_dot, p) - _cross(omega, _cross(omega, p))
        tau = sample.tau.copy()
        tau[:FREE] = 0.0
        q, v, a = self._base.state(sample.q[FREE:], sample.v[FREE:], sample.a[FREE:], omega, force, omega_dot)
        return Sample(sample.t, q, v, a, tau)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of two vectors (3,); numpy's own takes as long as the whole inverse dynamics."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
