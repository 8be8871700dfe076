"""FloatingDerivative: measurements of legs and IMU to samples of all joints of a floating base."""

from __future__ import annotations

from collections import deque

import numpy as np
from numba import njit

from sysid_ros.sample import FREE, FloatArray, Measurement, Sample
from sysid_ros.signals.causal_filters import CausalDerivative


class FloatingDerivative:
    """As :class:`CausalDerivative`, for a robot whose first six joints are those of its trunk.

    The angles of the trunk's turns are the integral of the gyro by the trapezoidal rule, so that their slope is the smoothed
    angular velocity and their second difference the centred difference of it, as raw as the accelerations of the legs, and all go
    through the same even grid. The specific force is moved from the IMU at ``p`` to the trunk's origin::

        s = f - dw x p - w x (w x p)

    Args:
        n: number of joints, those of the trunk included.
        period, half_width, use_message_velocity: as of :class:`CausalDerivative`.
    """

    def __init__(self, n: int, period: float, half_width: int, use_message_velocity: bool = False) -> None:
        self._n = n
        self._inner = CausalDerivative(n, period, half_width, use_message_velocity, impacts=True)
        self._turned = np.zeros(3)
        self._last: tuple[float, FloatArray] | None = None
        self._place = np.zeros(3)
        self._reported: deque[tuple[float, FloatArray | None]] = deque(maxlen=4 * half_width + 16)

    @property
    def spikes(self) -> int:
        """As of :class:`CausalDerivative`."""
        return self._inner.spikes

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
        self._reported.append((measurement.t, trunk.contacts))
        q, tau = np.zeros(self._n), np.zeros(self._n)
        # the specific force goes where a force of the trunk's slides would: through the same grid and the same delay
        q[3:FREE], q[FREE:], tau[:3], tau[FREE:] = self._turned, measurement.q, trunk.force, measurement.tau
        v = None if measurement.v is None else np.concatenate((np.zeros(3), trunk.omega, measurement.v))
        return [self._of_all_joints(sample) for sample in self._inner.push(Measurement(measurement.t, q, v, tau))]

    def contacts(self, t: float) -> FloatArray | None:
        """Which feet were reported to stand at t, shape (k,); None where no message says."""
        reported = None
        for at, contacts in self._reported:
            if at > t + 1e-9:
                break
            reported = contacts
        return reported

    def _of_all_joints(self, sample: Sample) -> Sample:
        q, v, a, tau = sample.q.copy(), sample.v.copy(), sample.a.copy(), sample.tau.copy()
        _hang(q, v, a, tau, self._place)
        return Sample(sample.t, q, v, a, tau)


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _hang(q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray, p: FloatArray) -> None:
    """The trunk's six joints from what went through the grid in their places, in place, as :class:`.FloatingBase` has them."""
    w, dw = v[3:6], a[3:6]
    lever = np.empty(3)  # w x p
    lever[0], lever[1], lever[2] = w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0]
    a[0] = tau[0] - (dw[1] * p[2] - dw[2] * p[1]) - (w[1] * lever[2] - w[2] * lever[1])
    a[1] = tau[1] - (dw[2] * p[0] - dw[0] * p[2]) - (w[2] * lever[0] - w[0] * lever[2])
    a[2] = tau[2] - (dw[0] * p[1] - dw[1] * p[0]) - (w[0] * lever[1] - w[1] * lever[0])
    a[3] -= w[1] * w[2]
    a[4] += w[0] * w[2]
    a[5] -= w[0] * w[1]
    q[:6] = 0.0
    v[:3] = 0.0
    tau[:6] = 0.0
