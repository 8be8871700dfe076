"""Cadence: how fast measurements come; ArmRows: from those of an arm to the filtered rows of the equation."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from sysid_ros.estimators.estimator import Noise
from sysid_ros.input_gate.clock_kernel import FIRST, HELD, SHARE, own_time
from sysid_ros.input_gate.source_clock import SourceClock
from sysid_ros.online.row_history import RowHistory
from sysid_ros.online.rows import Rows
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.signals.causal_filters import CausalDerivative
from sysid_ros.signals.cutoff import acceleration_variance, default_cutoff, position_noise, window_half_width
from sysid_ros.signals.low_pass import LowPassBank
from sysid_ros.torque.compiled_rows import BESIDE
from sysid_ros.torque.torque_model import TorqueModel

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
_FILLED = 0.98
"""Part of the low-pass above which it counts as filled."""
_NOISE_EVERY = 10
"""Rows after which what the noise of the accelerations does to them is looked at again."""


class Cadence:
    """Reads the period between measurements from the first of them, watches that it stays, and puts them at their own times.

    Args:
        max_gap: a longer step between measurements breaks the row of them [s].
        joints: of an arm, whose positions tell the errors of the stamps; 0 for another robot, whose stamps stay as they are.

    Attributes:
        clock: that the measurements are taken by, None where that is not asked. turned: the newest measurement is the first that
            shows it to be better than the stamps, so that those before were at wrong times.
    """

    def __init__(self, max_gap: float, joints: int = 0) -> None:
        self._max_gap = max_gap
        self._last_t = -math.inf
        self.clock = SourceClock(joints) if joints else None
        self.turned = self._turned_once = False
        self.restart()

    def restart(self) -> None:
        """Forget the rate; the next measurement is a first one."""
        self._first: list[Measurement] = []
        self._held: list[Measurement] = []
        self._period = self._usual = 0.0
        self._longest_step = math.inf
        self._since_check, self._checked_t = 0, 0.0

    @property
    def in_words(self) -> list[str]:
        """What was found of the stamps, a sentence if anything."""
        said = self.clock.in_words() if self.clock else ""
        return [said] if said else []

    def follows(self, t: float) -> bool:
        """Take in a stamp [s]. False where it does not follow the ones before: time jumped, there was a gap, or measurements come
        at another rate than the first of them did, as after a burst."""
        step, self._last_t = t - self._last_t, t
        if not 0.0 < step <= self._longest_step:
            return False
        self._since_check += 1
        return self._since_check < _CHECK_EVERY or self._keeps_rate(t)

    def take(self, measurement: Measurement) -> list[Measurement]:
        """Take in a measurement; those that are known now at the times at which their values were true. None before there are
        enough of them to know the rate, nor of one that repeats the one before, as of a driver that polls a slower source."""
        if self._period == 0.0:
            return self._take_first(measurement)
        if self.clock is None:
            return [measurement]
        state, m = self.clock.state, measurement
        t = own_time(*state, m.t, m.q, m.tau)
        self.turned = bool(state[0][SHARE] > 0.0) and not self._turned_once
        if self.turned:
            self._turned_once, self._period = True, max(self.clock.period, _SHORTEST_PERIOD)
        if math.isnan(t):
            self._held.append(m)
            return []
        if self._held:
            held, self._held = self._held, []
            if state[0][HELD] != 0.0:  # they were no repeats: the robot stands, or its driver hangs
                return [Measurement(x.t + (t - m.t), x.q, x.v, x.tau) for x in (*held, m)]
        return [m] if t == m.t else [Measurement(t, m.q, m.v, m.tau)]

    def _take_first(self, measurement: Measurement) -> list[Measurement]:
        self._longest_step = _LONGEST_STEP
        self._first.append(measurement)
        if len(self._first) < FIRST:
            return []
        first, self._first = self._first, []
        self._usual = max(float(np.median(np.diff([m.t for m in first]))), _SHORTEST_PERIOD)
        self._period = self._usual if self.clock is None else max(self.clock.begin(first), _SHORTEST_PERIOD)
        self._since_check, self._checked_t = 0, measurement.t
        self._longest_step = max(min(self._max_gap, _LONGEST_FILL * self._period), 3.5 * self._period)
        return first if self.clock is None else [known for m in first for known in self.take(m)]

    @property
    def period(self) -> float:
        """Usual time between measurements, once known [s]."""
        return self._period

    def _keeps_rate(self, t: float) -> bool:
        faster = self._since_check * self._usual / (t - self._checked_t)
        self._since_check, self._checked_t = 0, t
        return 0.6 < faster < 1.4


class ArmRows:
    """Derivative, split into known and free, and the low-pass on both sides.

    Args:
        model: what is known and what is free. cutoff_hz: of the low-pass [Hz]. period: usual time between measurements [s].
        every: samples from one row to the next. use_message_velocity: as of :class:`.CausalDerivative`.
        adapts: the cut-off may be another one. noise: standard deviation of the positions' white noise [rad].

    Attributes:
        derivative: what makes samples of measurements. bank: the low-pass. rows: of an update.
        noise: as it was last measured. too_fast: True where the low-pass lets too much of it pass.
    """

    def __init__(
        self,
        model: TorqueModel,
        cutoff_hz: float,
        period: float,
        every: int,
        use_message_velocity: bool,
        adapts: bool,
        noise: float,
    ) -> None:
        n, rate = model.robot.n, 1.0 / period
        self.rows, self._p, self._every = n, model.p, every
        self._error = model.error
        self.derivative = CausalDerivative(n, period, window_half_width(rate), use_message_velocity)
        self._compiled = model.compiled()
        self.bank = LowPassBank(self._compiled.empty.shape, cutoff_hz, rate)
        self._history = RowHistory(self._compiled.empty, model.slices[0], period, self.bank)
        self._filling, self._fresh = round(self.bank.memory / (every * period)), 0
        self._rising = 0
        self.bank.rest()  # primed with a first acceleration, a second difference, it would hold that one's noise for long
        self.noise, self._since = noise, 0
        self._adapts, self.too_fast, self._positions = adapts, False, list[FloatArray]()
        self._pushed, self._still = np.tile(self._compiled.empty, (n, 1, 1)), self._compiled.empty.copy()
        self._tick = -max(round(2.0 * self.bank.memory * rate), every)

    def push(self, measurement: Measurement) -> list[Rows]:
        """Rows that are due: none while the filters fill and between updates, seldom more than one."""
        self._positions.append(measurement.q)
        if len(self._positions) == _CHECK_EVERY:
            self.noise, self._positions = position_noise(np.array(self._positions)), []
            right = default_cutoff(1.0 / self.derivative.period, self.noise)
            self.too_fast = self._adapts and right < _FINER * self.bank.cutoff_hz
        due: list[Rows] = []
        derivative, history = self.derivative, self._history
        for k in range(derivative.advance(measurement)):
            t, motion = derivative.times[k], derivative.channels[k]
            part = 1.0 if self._rising < 0 else history.rise[self._rising]
            self._compiled.push(t, motion, history.ring[history.count % history.size], part, self.bank)
            self._rising = self._rising + 1 if 0 <= self._rising < history.rise.size - 1 else -1
            history.count += 1
            self._tick += 1
            sampled = None
            if self._tick >= 0 and self._tick % self._every == 0:
                sampled = motion.copy()
                due.append(self._rows(float(t), sampled))
            history.samples.append((t, sampled))
        return due

    def rest(self) -> None:
        """Rows to come hold nothing of what has been."""
        self.bank.rest()
        self._history.clear()
        self._rising = 0

    def settle_links(self, model: TorqueModel, mean: FloatArray, root: FloatArray) -> None:
        """Rows to come are those of ``model``, whose links and what they carry are wrong by ``mean + root z``, and so are all
        that have gone into the filters; see :class:`.Told`."""
        first, load = self._p + BESIDE, model.slices[0]
        known = np.r_[load, first : self.bank.output.shape[1]]
        matrix = np.eye(self.bank.output.shape[1], first + root.shape[1])
        matrix[first:] = 0.0
        matrix[known, self._p] -= mean[: known.size]
        matrix[known, first:] = root[: known.size]
        self.bank.mix(matrix)
        self._history.settle(mean, root, matrix)
        self._compiled = model.compiled()
        self._pushed, self._still = np.tile(self._compiled.empty, (self.rows, 1, 1)), self._compiled.empty.copy()

    def since_change(self, theta: FloatArray, variance: FloatArray, prior_variance: FloatArray) -> tuple[float, list[Rows]]:
        """As of :class:`.FrontEnd`."""
        replayed = self._history.replay(self._history.onset(theta, variance, prior_variance))
        rows = [self._rows(t, motion) for t, motion in replayed]
        since = self._history.samples
        self._rising = len(since) if len(since) < self._history.rise.size else -1
        return float(since[0][0]), rows

    def _rows(self, t: float, motion: FloatArray) -> Rows:
        """What the low-pass shows now, one row a joint; ``motion``: q, v, a, tau of the newest sample, shape (4, n)."""
        p, out = self._p, self.bank.output
        n, error = self.rows, self._error
        Y, considered, beside = np.empty((n, p)), np.empty(error.gains.shape), np.empty((5, n))
        filled = _split(out, p, Y, beside, considered, error.gains)
        self._fresh = self._filling if filled < _FILLED else max(self._fresh - 1, 0)
        self._since = (self._since + 1) % _NOISE_EVERY
        noise = self._noise(t, motion[0]) if self._since == 0 and self.noise > 0.0 else None
        y, channels = beside[0], (beside[1], beside[2], beside[3], beside[4])
        self._history.updates.append((Y, y, considered))
        return Rows(Y, y, *channels, considered, t, motion[0], motion[1], noise=noise, fresh=self._fresh > 0)

    def _noise(self, t: float, q: FloatArray) -> Noise:
        """What a standard deviation of each joint's acceleration does to a row."""
        variance = acceleration_variance(1.0 / self.derivative.period, self.noise, self.bank.cutoff_hz)
        p, motion = self._p, np.zeros((4, self.rows))
        motion[0] = q
        self._compiled.fill(t, motion, self._still)
        for pushed, unit in zip(self._pushed, math.sqrt(variance) * np.eye(self.rows), strict=True):
            motion[2] = unit
            self._compiled.fill(t, motion, pushed)
        moved = self._pushed - self._still
        also = np.zeros((*moved.shape[:2], self._error.gains.shape[1]))
        also[:, :, : self._error.c] = moved[:, :, p + BESIDE :]
        return np.ascontiguousarray(moved[:, :, :p]), moved[:, :, p].copy(), also


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _split(out: FloatArray, p: int, Y: FloatArray, beside: FloatArray, considered: FloatArray, gains: FloatArray) -> float:
    """What the low-pass shows, in the arrays of :class:`.Rows`: y, speed, slow, acceleration and tau are rows of ``beside``.
    How far the low-pass is filled, over which the means beside the equation are taken. ``gains``: see :class:`.KnownError`."""
    known = out.shape[1] - p - BESIDE
    filled = out[0, p + 5]
    part = max(filled, 0.02) if filled < _FILLED else 1.0
    for i in range(out.shape[0]):
        Y[i] = out[i, :p]
        torque = out[i, p + 3]
        for k in range(considered.shape[1]):
            considered[i, k] = gains[i, k] * torque
        for k in range(known):
            considered[i, k] += out[i, p + BESIDE + k]
        beside[0, i] = out[i, p]
        beside[1, i] = abs(out[i, p + 1]) / part
        beside[2, i] = abs(out[i, p + 4]) / part
        beside[3, i] = out[i, p + 2] / part
        beside[4, i] = torque
    return float(filled)
