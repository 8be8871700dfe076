"""Cadence: how fast measurements come; FrontEnd: from them to filtered rows of the equation at the estimator's rate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from sysid_ros.floating.contact_projection import ContactProjection
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.gravity_row import GravityRow, StandingColumns
from sysid_ros.floating.stance_log import StanceLog
from sysid_ros.sample import FREE, FloatArray, Measurement, Sample
from sysid_ros.signals.causal_filters import CausalDerivative, LowPassBank, default_cutoff, window_half_width
from sysid_ros.signals.floating_derivative import FloatingDerivative
from sysid_ros.torque.torque_model import TorqueModel

_TRUSTED = 0.99
"""Part of a row that is from when the feet carried the robot, from which on their velocity is that of the trunk."""
_SLOW = 0.06
"""Speed of a joint below which dry friction is not what a model says [rad/s]."""
FIRST = 25
"""Measurements from which rate and noise of the torque are read before anything is estimated."""
_LONGEST_STEP = 1.0
"""Longest time between measurements while the rate is not known [s]."""
_SHORTEST_PERIOD = 5e-5
"""Measurements do not come faster, whatever their stamps say [s]."""
_CHECK_EVERY = 300
"""Measurements after which the rate is looked at again."""
_LONGEST_FILL = 10.5
"""Longest step that is interpolated over [periods]."""


class Cadence:
    """Reads the period between measurements from the first of them, and watches that it stays.

    Args:
        max_gap: a longer step between measurements breaks the row of them [s].
    """

    def __init__(self, max_gap: float) -> None:
        self._max_gap = max_gap
        self._last_t = -math.inf
        self.restart()

    def restart(self) -> None:
        """Forget the rate; the next measurement is a first one."""
        self._first: list[Measurement] = []
        self._period = 0.0
        self._longest_step = math.inf
        self._since_check, self._checked_t = 0, 0.0

    def follows(self, t: float) -> bool:
        """Take in a stamp [s]. False where it does not follow the ones before: time jumped, there was a gap, or measurements come
        at another rate than the first of them did, as after a burst."""
        step, self._last_t = t - self._last_t, t
        if not 0.0 < step <= self._longest_step:
            return False
        self._since_check += 1
        return self._since_check < _CHECK_EVERY or self._keeps_rate(t)

    def first(self, measurement: Measurement) -> list[Measurement]:
        """Take in one of the first measurements; all of them, once there are enough to know the rate."""
        self._longest_step = _LONGEST_STEP
        self._first.append(measurement)
        if len(self._first) < FIRST:
            return []
        first, self._first = self._first, []
        self._period = max(float(np.median(np.diff([m.t for m in first]))), _SHORTEST_PERIOD)
        self._since_check, self._checked_t = 0, measurement.t
        self._longest_step = max(min(self._max_gap, _LONGEST_FILL * self._period), 3.5 * self._period)
        return first

    @property
    def period(self) -> float:
        """Usual time between measurements, once known [s]."""
        return self._period

    def _keeps_rate(self, t: float) -> bool:
        faster = self._since_check * self._period / (t - self._checked_t)
        self._since_check, self._checked_t = 0, t
        return 0.6 < faster < 1.4


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
        considered: torque of the errors of what is known, shape (n, c) [N m], see :class:`.known_effect.KnownError`.
        sample: the newest sample that went in, not filtered.
        trust: part of the row from when the feet of a floating base carried it, 0 to 1; 1 on an arm.
    """

    Y: FloatArray
    y: FloatArray
    speed: FloatArray
    slow: FloatArray
    acceleration: FloatArray
    tau: FloatArray
    considered: FloatArray
    sample: Sample
    trust: float = 1.0


class FrontEnd:
    """Derivative, split into known and free, the low-pass on both sides, and every k-th of it.

    On a floating base the rows go through :class:`ContactProjection` before the low-pass, and six are left of n. What was
    measured while the feet did not carry the robot is left out of them: the equation times a window is still an equation.

    Args:
        model: what is known and what is free.
        period: usual time between measurements [s].
        update_rate: rows a second at most [Hz].
        cutoff_hz: of the low-pass [Hz]; 0 for the default of the rate.
        use_message_velocity: velocity from the messages instead of from the positions.
        base: the robot of ``model`` where it floats. standstill: velocity below which it stands [rad/s]. stances: takes note of
            what its feet do. gravity: at the place [m/s^2], with which a free bias of the accelerometer is told from a load.
        bias: where that bias stands among the free parameters, None where it is not free.

    Attributes:
        projection: of a floating base, else None. rows: of an update.
        passed: variance of a row over the long-run variance of the rows, for white noise.
        rate: measurements a second [Hz]. period: time between rows [s].
        memory: time after which a measurement has left the rows [s]. delay: of the rows behind their sample [s].
    """

    def __init__(
        self,
        model: TorqueModel,
        period: float,
        update_rate: float,
        cutoff_hz: float = 0.0,
        use_message_velocity: bool = False,
        base: FloatingBase | None = None,
        standstill: float = 0.05,
        stances: StanceLog | None = None,
        gravity: float = 9.81,
        bias: slice | None = None,
    ) -> None:
        self._model = model
        n, p = model.robot.n, model.p
        self.rate = 1.0 / period
        derivative = CausalDerivative if base is None else FloatingDerivative
        self._derivative = derivative(n, period, window_half_width(self.rate), use_message_velocity)
        self._raw = np.zeros((n, p + 5 + model.error.c))
        self._columns, self._rest, self._considered = self._raw[:, :p], self._raw[:, p], self._raw[:, p + 5 :]
        cutoff = min(cutoff_hz or default_cutoff(self.rate), 0.4 * self.rate)
        self.rows = n if base is None else FREE
        self._bank = LowPassBank((self.rows, self._raw.shape[1]), cutoff, self.rate)
        self._every = max(1, round(self.rate / update_rate))
        self.period = self._every * period
        self.passed = min(2.05 * cutoff * self.period, 1.0)
        self.memory = self._bank.memory
        self.delay = self._bank.delay
        self._tick = -max(round(2.0 * self.memory * self.rate), self._every)
        self.projection = None if base is None else ContactProjection(base)
        self._stances = stances
        if base is not None:
            self._projected = np.zeros((FREE, self._raw.shape[1]))
            self._beside = np.zeros((n + 1, 2))
            self._beside_bank = LowPassBank(self._beside.shape, cutoff, self.rate)
            self._standing = StandingColumns(self.period, standstill)
            self._gravity = GravityRow(gravity, cutoff, self.rate, self.period)
            self._bias = bias
            self.rows += bias is not None

    def push(self, measurement: Measurement) -> list[Rows]:
        """Rows that are due: none while the filters fill and between updates, seldom more than one."""
        due = []
        for sample in self._derivative.push(measurement):
            self._model.split_into(sample, self._columns, self._rest, self._considered)
            _fill_beside(self._raw, self._model.p + 1, sample.v, sample.a, sample.tau)
            if self.projection is None:
                self._bank.push(self._raw)
            else:
                self._project(sample, self.projection)
            self._tick += 1
            if self._tick >= 0 and self._tick % self._every == 0:
                due.append(self._rows(sample) if self.projection is None else self._rows_of_trunk(sample))
        return due

    def _rows(self, sample: Sample) -> Rows:
        """What the low-pass shows now, one row a joint."""
        p, out = self._model.p, self._bank.output
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

    def _project(self, sample: Sample, projection: ContactProjection) -> None:
        """Put the six rows that are free of the forces on the feet, and what goes beside them, through the low-pass."""
        beside = self._beside
        assert isinstance(self._derivative, FloatingDerivative)
        stance = projection.update(sample, self._rest, self._derivative.contacts(sample.t))
        if self._stances is not None:
            self._stances.add(stance, sample.t)
        if stance.trusted:
            projection.apply(self._raw, self._projected)
        else:
            self._projected[:] = 0.0
        self._gravity.push(sample, projection.points, projection.loads)
        beside[:-1, 0], beside[:-1, 1], beside[-1] = sample.v, sample.a, stance.trusted
        self._bank.push(self._projected)
        self._beside_bank.push(beside)

    def _rows_of_trunk(self, sample: Sample) -> Rows:
        """As :meth:`_rows`, the six rows of the trunk and that of gravity where the accelerometer's bias is free."""
        p, out, other = self._model.p, self._bank.output, self._beside_bank.output
        trust, speed = float(other[-1, 0]), np.abs(other[:-1, 0])
        vertical, excess = self._gravity.row()
        if self._stances is not None and trust > _TRUSTED:
            self._stances.add_gravity(excess)
        Y, y, tau = np.zeros((self.rows, p)), np.zeros(self.rows), np.zeros(self.rows)
        Y[:FREE], y[:FREE], tau[:FREE] = out[:, :p], out[:, p], out[:, p + 3]
        payload = self._model.slices[0]
        Y[:FREE, payload] = self._standing.push(np.ascontiguousarray(out[:, payload]), speed, trust > _TRUSTED)
        if self._bias is not None and trust > _TRUSTED:
            Y[FREE, self._bias], y[FREE] = vertical, excess
        considered = np.zeros((self.rows, self._model.error.c))
        considered[:FREE] = out[:, p + 5 :]
        return Rows(
            Y=Y,
            y=y,
            speed=speed,
            slow=np.zeros(self.rows),
            acceleration=other[:-1, 1].copy(),
            tau=tau,
            considered=considered,
            sample=sample,
            trust=trust,
        )


@njit(cache=True)  # type: ignore[untyped-decorator]
def _fill_beside(raw: FloatArray, first: int, v: FloatArray, a: FloatArray, tau: FloatArray) -> None:
    """The channels beside the equation: v, a, tau and how far each joint is from moving, in four columns from ``first`` on."""
    for j in range(v.size):
        raw[j, first] = v[j]
        raw[j, first + 1] = a[j]
        raw[j, first + 2] = tau[j]
        raw[j, first + 3] = max(1.0 - abs(v[j]) / _SLOW, 0.0)
