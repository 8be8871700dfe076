"""TrunkRows: rows of a robot on legs; GravityRow: what its accelerometer must show; StandingColumns: constant ones at rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit

from sysid_ros.floating.contact_kernels import turn_direction
from sysid_ros.floating.contact_projection import ContactProjection
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.stance_log import StanceLog
from sysid_ros.floating.trunk_inertia import TrunkInertia
from sysid_ros.sample import FREE, FloatArray, Sample
from sysid_ros.signals.low_pass import LowPassBank

_FOLLOWS = 2.0
"""Time in which the vertical follows the accelerometer [s]: some steps."""
_GAP = 0.5
"""Between samples from which on they do not follow one another [s]."""
_TRUSTED = 0.99
"""Part of a row that is from when the feet carried the robot, from which on their velocity is that of the trunk."""


class TrunkRows:
    """The equation's rows of a floating base through :class:`ContactProjection` and the low-pass: six are left of n, and that of
    gravity where a bias of the accelerometer is free.

    What was measured while the feet did not carry the robot is left out: the equation times a window is still an equation.

    Args:
        base: the robot. channels: of each raw row: the columns of the p free effects, the torque left for them, v, a, tau and
            how far each joint is from moving, and what is considered. p: see there. inertia: of robot and load.
        cutoff_hz, rate: of the low-pass [Hz]. period: between rows [s]. standstill: velocity below which it stands [rad/s].
        stances: takes note of what the feet do. gravity: at the place [m/s^2], by which a free bias is distinguished from a load.
        bias: where it stands among the free parameters, None where it is not free.
        radius, delay: of the feet and of the IMU, as ``bias``: see :meth:`ContactProjection.by_radius` and :meth:`_late`.
        moving: columns that nothing but motion makes: at rest they are noise, that of the rows themselves, and left out.

    Attributes:
        projection: the step before the low-pass. bank: the low-pass. rows: of an update.
    """

    def __init__(
        self,
        base: FloatingBase,
        channels: int,
        p: int,
        inertia: TrunkInertia,
        cutoff_hz: float,
        rate: float,
        period: float,
        standstill: float = 0.05,
        stances: StanceLog | None = None,
        gravity: float = 9.81,
        bias: slice | None = None,
        radius: slice | None = None,
        delay: slice | None = None,
        moving: Sequence[slice] = (),
    ) -> None:
        self._p, self._inertia, self._bias, self._stances = p, inertia, bias, stances
        self._radius, self._delay = radius, delay
        self._moving = moving
        self.projection = ContactProjection(base)
        self._projected, self._beside = np.zeros((FREE, channels)), np.zeros((base.robot.n + 1, 2))
        self._moved: tuple[float, FloatArray] = -np.inf, np.zeros(FREE)
        self.bank = LowPassBank(self._projected.shape, cutoff_hz, rate)
        self._beside_bank = LowPassBank(self._beside.shape, cutoff_hz, rate)
        self._standing = StandingColumns(period, standstill)
        self._gravity = GravityRow(gravity, cutoff_hz, rate, period)
        self.rows = FREE + (bias is not None)

    def push(self, sample: Sample, raw: FloatArray, reported: FloatArray | None) -> None:
        """Take in the raw rows (n, channels) of a sample; ``reported``: feet that stand, see :meth:`ContactProjection.update`."""
        beside, projection = self._beside, self.projection
        late = self._late(sample) if self._delay is not None else None
        stance = projection.update(sample, raw[:, self._p], reported)
        if self._stances is not None:
            self._stances.add(stance, sample.t, projection.points)
        if stance.trusted:
            if self._delay is not None:
                raw[:, self._delay.start] = late
            projection.multiply(raw, self._projected)
            if self._radius is not None:
                self._projected[:, self._radius.start] = -projection.by_radius(raw[:, self._p])
            projection.whiten(self._projected)
        else:
            self._projected[:] = 0.0
        self._gravity.push(sample, projection.points, projection.loads)
        beside[:-1, 0], beside[:-1, 1], beside[-1] = sample.v, sample.a, stance.trusted
        self.bank.push(self._projected)
        self._beside_bank.push(beside)

    def due(self) -> dict[str, Any]:
        """What the low-pass shows now, the fields of :class:`sysid_ros.online.front_end.Rows` but for the sample."""
        p, out, other = self._p, self.bank.output, self._beside_bank.output
        trust, speed = float(other[-1, 0]), np.abs(other[:-1, 0])
        vertical, excess = self._gravity.row()
        if self._stances is not None and trust > _TRUSTED:
            self._stances.add_gravity(excess)
        Y, y, tau = np.zeros((self.rows, p)), np.zeros(self.rows), np.zeros(self.rows)
        Y[:FREE], y[:FREE], tau[:FREE] = out[:, :p], out[:, p], out[:, p + 3]
        Y[:FREE] = self._standing.push(Y[:FREE], speed, trust > _TRUSTED)
        if self._standing.stands:
            for where in self._moving:
                Y[:, where] = 0.0
        if self._bias is not None and trust > _TRUSTED:
            Y[FREE, self._bias], y[FREE] = vertical, excess
        considered = np.zeros((self.rows, out.shape[1] - p - 6))
        considered[:FREE] = out[:, p + 6 :]
        values = {"Y": Y, "y": y, "speed": speed, "slow": np.zeros(self.rows), "tau": tau, "considered": considered}
        return values | {"acceleration": other[:-1, 1].copy(), "trust": trust}

    def _late(self, sample: Sample) -> FloatArray:
        """What a second of delay of the IMU does: ``a(t) = a'(t + d) = a' + d da'/dt``, so that the equation holds ``d`` times
        what the slope of the trunk's acceleration costs robot and load, shape (n,). It is left out where the feet did not carry
        the robot, as all else: the slope of what is left in would have the edges of that in it."""
        (t, before), self._moved = self._moved, (sample.t, sample.a[:FREE].copy())
        if not 0.0 < sample.t - t < _GAP:
            return np.zeros_like(sample.a)
        slope = (sample.a[:FREE] - before) / (sample.t - t)
        return np.asarray(self._inertia.columns(sample.q) @ slope)


class GravityRow:
    """One more row of the equation, which knows nothing of masses and so tells the accelerometer's bias b from a load::

        s + b - (dv/dt + w x v) = g u + b,       | g u + b | = g + u' b

    with s the specific force, v and w the velocity and the angular velocity of the trunk in its own axes, u the vertical. The
    feet that stand tell v, each by its share of the load: ``0 = v + w x p + J_l v_l`` at each point p where one touches. The
    derivative of v is that of the low-passed v, so its error has no mean however often feet change (Bloesch et al. 2013 fuse the
    same measurements in a filter).

    The vertical u follows the gyro, and the direction of ``g u`` itself only within seconds (a complementary filter: Mahony et
    al. 2008). Along it noise has no mean either, whereas the size of a noisy vector is always too large.

    Args:
        gravity: at the place [m/s^2]. cutoff_hz, rate: of the low-pass [Hz]. period: between rows [s].
    """

    def __init__(self, gravity: float, cutoff_hz: float, rate: float, period: float) -> None:
        self._gravity, self._period = gravity, period
        self._raw = np.zeros((2, 3))
        self._bank = LowPassBank(self._raw.shape, cutoff_hz, rate)
        self._before: FloatArray | None = None
        self._vertical: FloatArray = np.zeros(3)
        self._t, self._seen = -np.inf, 0.0

    def push(self, sample: Sample, points: FloatArray, load: FloatArray) -> None:
        """Take in a sample, with the Jacobians (k, 3, n) of the points that touch and the force on each, shape (k,)."""
        _observe(sample.v, sample.a, points, load, self._raw)
        self._bank.push(self._raw)
        dt = sample.t - self._t
        if 0.0 < dt < _GAP:
            turn_direction(self._vertical, sample.v[3:6], dt)
        self._t = sample.t

    def row(self) -> tuple[FloatArray, float]:
        """u, shape (3,), and ``u' b`` [m/s^2], of the time since the row before."""
        now = self._bank.output.copy()
        before, self._before = self._before, now
        if before is None:
            before = now
        gravity = 0.5 * (now[0] + before[0]) - (now[1] - before[1]) / self._period
        self._seen += self._period
        share = max(self._period / self._seen, self._period / _FOLLOWS)
        # the low-passed vector is of a while ago; over the seconds of the average that is nothing
        vertical = self._vertical + share * (gravity / max(float(np.linalg.norm(gravity)), 1e-9) - self._vertical)
        self._vertical = vertical / max(float(np.linalg.norm(vertical)), 1e-9)
        return self._vertical.copy(), float(self._vertical @ gravity) - self._gravity


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _observe(v: FloatArray, a: FloatArray, points: FloatArray, load: FloatArray, out: FloatArray) -> None:
    """``s - w x v`` and ``v`` into the rows of ``out``; without a foot on the ground v stays as it was."""
    total = 0.0
    for i in range(load.size):
        total += max(load[i], 0.0)
    if total > 0.0:
        out[1] = 0.0
        for i in range(load.size):
            share = max(load[i], 0.0) / total
            if share > 0.0:
                for c in range(3):
                    for j in range(v.size):
                        out[1, c] -= share * points[i, c, j] * v[j]
    w, velocity = v[3:6], out[1]
    out[0, 0] = a[0] - (w[1] * velocity[2] - w[2] * velocity[1])
    out[0, 1] = a[1] - (w[2] * velocity[0] - w[0] * velocity[2])
    out[0, 2] = a[2] - (w[0] * velocity[1] - w[1] * velocity[0])


_STANDS = 0.15
"""Time below the standstill velocity after which the robot stands [s]."""


class StandingColumns:
    """Replaces the columns by their mean since the robot stands.

    Noise in the measured accelerations makes the columns of each row a little different, which pretends an excitation that is
    not there, and least squares on them tends to zero. The mean over m rows has an m-th of the noise's variance, so that m rows
    of it add next to no information in directions that rest does not determine.

    Args:
        period: between rows [s]. velocity: below it on every joint and turn the robot stands [rad/s].
    """

    def __init__(self, period: float, velocity: float) -> None:
        self._period, self._velocity = period, velocity
        self._still = 0.0
        self._count = 0
        self._mean: FloatArray = np.zeros((0, 0))

    @property
    def stands(self) -> bool:
        """Whether it has stood for a while."""
        return self._still > _STANDS

    def push(self, columns: FloatArray, speed: FloatArray, whole: bool = True) -> FloatArray:
        """The columns (m, p) to use, given the velocities of the joints, shape (n,); ``whole`` is False where a part of what was
        measured is left out of them."""
        self._still = self._still + self._period if whole and float(speed.max()) < self._velocity else 0.0
        if self._still <= _STANDS:
            self._count = 0
            return columns
        self._count += 1
        self._mean = columns.copy() if self._count == 1 else self._mean + (columns - self._mean) / self._count
        return self._mean.copy()
