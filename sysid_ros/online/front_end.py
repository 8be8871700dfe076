"""Cadence: how fast measurements come; FrontEnd: from them to filtered rows of the equation at the estimator's rate."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.stance_log import StanceLog
from sysid_ros.floating.trunk_rows import TrunkRows
from sysid_ros.online.arm_rows import ArmRows
from sysid_ros.online.leg_parameters import LegParameters
from sysid_ros.online.rows import Rows
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.signals.causal_filters import CausalDerivative, fill_beside
from sysid_ros.signals.cutoff import default_cutoff, position_noise, window_half_width
from sysid_ros.signals.floating_derivative import FloatingDerivative
from sysid_ros.torque.compiled_rows import BESIDE
from sysid_ros.torque.torque_model import TorqueModel

FIRST = 25
"""Measurements from which rate and noise of the torque are read before anything is estimated."""
_LONGEST_STEP = 1.0
"""Longest time between measurements while the rate is not known [s]."""
_SHORTEST_PERIOD = 5e-5
"""Measurements do not come faster, whatever their stamps say [s]."""
_CHECK_EVERY = 300
"""Measurements after which rate and noise of the positions are looked at again."""
_FINER = 0.8
"""A cut-off that is right below so much of the one at work takes its place."""
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


class FrontEnd:
    """Derivative, split into known and free, the low-pass on both sides, and every k-th of it.

    On a floating base the rows are those of :class:`TrunkRows`.

    Args:
        model: what is known and what is free.
        period: usual time between measurements [s]. update_rate: rows a second at most [Hz].
        cutoff_hz: of the low-pass [Hz]; 0 for what suits rate and noise of the positions, which is ``noise`` [rad, rms].
        use_message_velocity: velocity from the messages instead of from the positions.
        base, legs: the robot of ``model`` where it floats, and what is not known of it.
        standstill, stances, gravity, bias: as of :class:`TrunkRows`.

    Attributes:
        derivative: what makes samples of measurements. projection: of a floating base, else None. rows: of an update.
        passed: variance of a row over the long-run variance of the rows, for white noise.
        rate: measurements a second [Hz]. period: time between rows [s]. makes_anew: rows can be made again since a change.
        noise: of the positions, as it was last measured [rad]. too_fast: True where the low-pass lets too much of it pass.
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
        noise: float = 0.0,
        legs: LegParameters | None = None,
    ) -> None:
        self._model = model
        self.rate = 1.0 / period
        cutoff = min(cutoff_hz or default_cutoff(self.rate, noise), 0.4 * self.rate)
        self._cutoff, self._adapts, self.noise = cutoff, not cutoff_hz and base is None, noise
        self.too_fast, self._positions = False, list[FloatArray]()
        self._every = max(1, round(self.rate / update_rate))
        self.period = self._every * period
        self._trunk: TrunkRows | None = None
        self._arm: ArmRows | None = None
        if base is None:
            self._arm = ArmRows(model, cutoff, period, self._every, use_message_velocity)
            self._arm.noise = noise
            self.derivative: CausalDerivative | FloatingDerivative = self._arm.derivative
            bank, self.rows, self.projection = self._arm.bank, self._arm.rows, None
        else:
            n, p = model.robot.n, model.p
            self._floating = FloatingDerivative(n, period, window_half_width(self.rate), use_message_velocity)
            self.derivative = self._floating
            assert legs is not None
            self._legs, self._hidden = legs, p + BESIDE + model.error.c
            self._raw = np.zeros((n, self._hidden + legs.considered))
            about = (cutoff, self.rate, self.period, standstill, stances, gravity, bias, legs.radius, legs.delay, legs.moving)
            self._trunk = TrunkRows(base, self._raw.shape[1], p, model.slices[0], *about)
            bank, self.rows, self.projection = self._trunk.bank, self._trunk.rows, self._trunk.projection
        self.makes_anew = self._arm is not None
        self.passed = min(2.05 * cutoff * self.period, 1.0)
        self.memory, self.delay = bank.memory, bank.delay
        self._tick = -max(round(2.0 * self.memory * self.rate), self._every)

    def push(self, measurement: Measurement) -> list[Rows]:
        """Rows that are due: none while the filters fill and between updates, seldom more than one."""
        if self._arm is not None:
            self._positions.append(measurement.q)
            if len(self._positions) == _CHECK_EVERY:
                self.noise, self._positions = position_noise(np.array(self._positions)), []
                self.too_fast = self._adapts and default_cutoff(self.rate, self.noise) < _FINER * self._cutoff
                self._arm.noise = self.noise
            return self._arm.push(measurement)
        assert self._trunk is not None
        due: list[Rows] = []
        raw, p = self._raw, self._model.p
        for sample in self._floating.push(measurement):
            self._model.split_into(sample, raw[:, :p], raw[:, p], raw[:, p + BESIDE : self._hidden])
            self._legs.fill(sample, raw[:, self._hidden :])
            fill_beside(raw, p + 1, sample.v, sample.a, sample.tau)
            self._trunk.push(sample, raw, self._floating.contacts(sample.t))
            self._tick += 1
            if self._tick >= 0 and self._tick % self._every == 0:
                due.append(Rows(**self._trunk.due(), sample=sample))
        return due

    def carry(self, load: FloatArray) -> None:
        """Take in the ten parameters of what is carried, of a floating base."""
        if self._trunk is not None:
            self._trunk.load = load

    def rest(self) -> None:
        """Rows to come hold nothing of what has been; not of a floating base."""
        if self._arm is not None:
            self._arm.rest()

    def settle_links(self, directions: FloatArray, mean: FloatArray, root: FloatArray) -> None:
        """What is known of an arm's links and load is wrong by ``directions (mean + root z)``, see :class:`.Told`: this is made
        good in the model and in all that has gone into the rows."""
        assert self._arm is not None
        self._model.settle_links(directions @ mean, directions @ root)
        self._arm.settle_links(self._model, mean, root)

    def since_change(self, theta: FloatArray, variance: FloatArray, prior_variance: FloatArray) -> tuple[float, list[Rows]]:
        """Where the first of the free effects has just changed: when [s], and the rows since then with nothing of the time before
        in them, as those to come will be; not of a floating base.

        Args:
            theta: free parameters before the change, shape (p,). variance: of a single row, shape (n,). prior_variance: of the
                parameters that changed.
        """
        assert self._arm is not None
        return self._arm.since_change(theta, variance, prior_variance)
