"""FrontEnd: measurements at the robot's rate to filtered rows of the equation at the estimator's rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from sysid_ros.low_pass import LowPassBank
from sysid_ros.sample import FloatArray, Measurement, Sample
from sysid_ros.signals import CausalDerivative, default_cutoff, window_half_width
from sysid_ros.torque_model import TorqueModel

_SLOW = 0.06
"""Speed of a joint below which dry friction is not what a model says [rad/s]."""


@dataclass(frozen=True, slots=True)
class Rows:
    """``y = Y theta + noise`` after the low-pass, one row a joint.

    Attributes:
        Y: columns of the free effects, shape (n, p).
        y: torque left for them, shape (n,) [N m].
        speed: absolute joint velocities, shape (n,) [rad/s].
        slow: part of the row from when the joint hardly moved, where dry friction is not what a model says, shape (n,), 0 to 1.
        acceleration: shape (n,) [rad/s^2].
        tau: measured torque, shape (n,) [N m].
        considered: torque of the errors of what is known, shape (n, c) [N m], see :class:`sysid_ros.known_error.KnownError`.
        sample: the newest sample that went in, not filtered.
    """

    Y: FloatArray
    y: FloatArray
    speed: FloatArray
    slow: FloatArray
    acceleration: FloatArray
    tau: FloatArray
    considered: FloatArray
    sample: Sample


class FrontEnd:
    """Derivative, split into known and free, the low-pass on both sides, and every k-th of it.

    Args:
        model: what is known and what is free.
        period: usual time between measurements [s].
        update_rate: rows a second at most [Hz].
        cutoff_hz: of the low-pass [Hz]; 0 for the default of the rate.
        use_message_velocity: velocity from the messages instead of from the positions.

    Attributes:
        rate: measurements a second [Hz]. period: time between rows [s].
        memory: time after which a measurement has left the rows [s]. delay: of the rows behind their sample [s].
    """

    def __init__(
        self, model: TorqueModel, period: float, update_rate: float, cutoff_hz: float = 0.0, use_message_velocity: bool = False
    ) -> None:
        self._model = model
        n, p = model.robot.n, model.p
        self.rate = 1.0 / period
        self._derivative = CausalDerivative(n, period, window_half_width(self.rate), use_message_velocity)
        self._raw = np.zeros((n, p + 5 + model.error.c))
        self._columns, self._rest, self._considered = self._raw[:, :p], self._raw[:, p], self._raw[:, p + 5 :]
        self._bank = LowPassBank(self._raw.shape, min(cutoff_hz or default_cutoff(self.rate), 0.4 * self.rate), self.rate)
        self._every = max(1, round(self.rate / update_rate))
        self.period = self._every * period
        self.memory = self._bank.memory
        self.delay = self._bank.delay
        self._tick = -max(round(2.0 * self.memory * self.rate), self._every)

    @property
    def filled(self) -> int:
        """Samples that were interpolated over lost measurements so far."""
        return self._derivative.filled

    def push(self, measurement: Measurement) -> list[Rows]:
        """Rows that are due: none while the filters fill and between updates, seldom more than one."""
        rows = [self._filter(sample) for sample in self._derivative.push(measurement)]
        return [r for r in rows if r is not None]

    def _filter(self, sample: Sample) -> Rows | None:
        p = self._model.p
        self._model.split_into(sample, self._columns, self._rest, self._considered)
        _fill_beside(self._raw, p + 1, sample.v, sample.a, sample.tau)
        out = self._bank.push(self._raw)
        self._tick += 1
        if self._tick < 0 or self._tick % self._every:
            return None
        return Rows(
            Y=np.ascontiguousarray(out[:, :p]),
            y=out[:, p].copy(),
            speed=np.abs(out[:, p + 1]),
            slow=np.abs(out[:, p + 4]),
            acceleration=out[:, p + 2].copy(),
            tau=out[:, p + 3].copy(),
            considered=np.ascontiguousarray(out[:, p + 5 :]),
            sample=sample,
        )


@njit(cache=True)  # type: ignore[untyped-decorator]
def _fill_beside(raw: FloatArray, first: int, v: FloatArray, a: FloatArray, tau: FloatArray) -> None:
    """The channels beside the equation: v, a, tau and how far each joint is from moving, in four columns from ``first`` on."""
    for j in range(v.size):
        raw[j, first] = v[j]
        raw[j, first + 1] = a[j]
        raw[j, first + 2] = tau[j]
        raw[j, first + 3] = max(1.0 - abs(v[j]) / _SLOW, 0.0)


def white_noise_variance(measurements: list[Measurement]) -> FloatArray:
    """Variance of the white part of the torques, shape (n,) [(N m)^2]: from their second differences, in which motion hardly
    shows.

    The median makes it robust against single faults; 0.455 is the median of chi-squared with one degree of freedom.
    """
    second = np.diff([m.tau for m in measurements], 2, axis=0)
    variance: FloatArray = np.median(second * second, axis=0) / 0.455 / 6.0
    return variance
