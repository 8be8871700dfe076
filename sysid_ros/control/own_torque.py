"""OwnTorque: what an arm carries, and how late its torques act, by the torques that its controller sends."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from sysid_ros.estimators import Estimator
from sysid_ros.estimators.estimator import Noise
from sysid_ros.online.arm_rows import Cadence
from sysid_ros.online.free_parameters import PAYLOAD, FreeParameters
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.online.rows import Rows
from sysid_ros.online.warm_up import warm_up
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.signals.cutoff import position_noise
from sysid_ros.torque.model_file import ModelFile

_UNEXPLAINED: Final = 1.2
"""Rows that do not fit, and that no jump explains, are a change all the same after so long [memories of the low-pass]."""
_STANDS: Final = 0.15
"""Time below the standstill velocity after which the arm stands [s]."""
_TAKEN_OVER: Final = 0.3
"""In which a better lead is taken over: one that jumped would move the arm [s]."""


class OwnTorque:
    """``F[tau(t - L)] = F[Y] theta + F[Y_f] phi + F[tau'(t - L)] d + noise``: the rows of the online estimation, of the torque
    that was sent.

    The torque needs no sensor, so that its noise is not in the rows: what is left is that of the positions and of the loop's
    jitter, and it is learned. The links' errors are not considered: what a controller needs is the body that makes its torques
    right, errors of the links beneath it included. L is half of the loop's delay T; the torque acts at L + d after the state that
    it answers, somewhere between none and T, so d has the standard deviation ``T / sqrt(12)`` before any data.

    A run of rows that another payload explains, or none, is a change (Willsky, Jones 1976): what is carried is forgotten, and
    learned from the rows that hold nothing of the time before.

    Args:
        robot: the arm. frame: that the payload is fixed to. known: the identified model of the empty arm, if any. delay: T [s].

    Attributes:
        lead: time from a state to the middle of that in which the torque acts that answers it [s].

    Raises:
        RobotModelError, ModelFileError: the frame or the model does not fit the robot.
    """

    def __init__(self, robot: RobotModel, frame: str, known: ModelFile | None, delay: float) -> None:
        self._settings = OnlineSettings(
            frame_id=frame, base="fixed", link_mass_error=0.0, link_com_error=0.0, effort_gain_error=0.0, base_tilt_std=0.0
        )
        self._robot = robot.with_links(np.zeros(10 * robot.n))  # its newest regressor is no one else's
        self._free = FreeParameters(self._robot, self._settings, known)
        self._delay, self._late_std = delay, delay / np.sqrt(12.0)
        self._cadence = Cadence(self._settings.max_gap)
        self._estimator: Estimator | None = None
        self.lead, self._stays = 0.5 * delay, 1.0
        self._begin()

    def compile(self) -> None:
        """Compile, or load from the cache, what :meth:`add` will call."""
        warm_up(self._robot, self._settings)

    def _begin(self) -> None:
        self._sent: deque[tuple[float, FloatArray]] = deque()
        self._rows: deque[Rows] = deque(maxlen=3)
        self._cadence.restart()
        self._front_end: FrontEnd | None = None
        self._still, self._passing = 0.0, 0.0
        self._shaken: FloatArray = np.zeros((0, self._robot.n, 10))

    @property
    def payload(self) -> tuple[FloatArray, FloatArray] | None:
        """Ten parameters, shape (10,), and their covariance, shape (10, 10); None while the noise is not known."""
        estimator = self._estimator
        if estimator is None or not estimator.noise_known:
            return None
        return estimator.parts(PAYLOAD)[:2]

    def interrupt(self) -> None:
        """The next state does not follow the one before."""
        self._begin()

    def forget(self) -> None:
        """Nothing is known of what is carried."""
        self._begin()
        if self._estimator is not None:
            self._estimator.forget()

    def add(self, t: float, q: FloatArray, v: FloatArray, sent: FloatArray) -> bool:
        """Take in a state at t [s] and the torque that was sent for it, shape (n,) each; True where something was learned."""
        if not self._cadence.follows(t):
            self._begin()
            self._cadence.follows(t)
        self._sent.append((t, sent))
        acting = self._acting(t - 0.5 * self._delay)
        if acting is None:
            return False
        measurement, learned = Measurement(t, q, v, acting), False
        first = self._cadence.take(measurement)
        if first and self._front_end is None:
            self._front_end = self._make_front_end(first)
        for m in first:
            for rows in self._front_end.push(m) if self._front_end is not None else ():
                self._rows.append(rows)
                if len(self._rows) == 3:
                    learned = self._take() or learned
        return learned

    def _acting(self, t: float) -> FloatArray | None:
        """The torque that was sent for a state at t, between those for the states around it, shape (n,)."""
        sent = self._sent
        while len(sent) > 1 and sent[1][0] <= t:
            sent.popleft()
        if len(sent) < 2 or sent[0][0] > t:
            return None
        (before, early), (after, late) = sent[0], sent[1]
        part = (t - before) / (after - before)
        return np.asarray((1.0 - part) * early + part * late)

    def _make_front_end(self, first: list[Measurement]) -> FrontEnd:
        s, noise = self._settings, position_noise(np.array([m.q for m in first]))
        front_end = FrontEnd(self._free.model, self._cadence.period, s.update_rate, s.cutoff_hz, noise=noise)
        if self._estimator is None:
            floor = self._free.noise_density(first, self._cadence.period) / front_end.period
            self._free.make_estimator(front_end, floor)
            white = 1.0 / front_end.passed
            self._stays, self._free.extra_colour = self._free.extra_colour / white, white
            self._estimator = self._free.make_again(front_end, floor, 1)
        return front_end

    def _take(self) -> bool:
        """Take in the middle one of the newest three sets of rows, with what a delay of the torque does to it."""
        front_end, estimator = self._front_end, self._estimator
        assert front_end is not None
        assert estimator is not None
        before, rows, after = self._rows
        period = front_end.period
        self._still = self._still + period if float(rows.speed.max()) < self._settings.standstill_velocity else 0.0
        self._passing -= period
        if self._passing > 0.0:
            return False
        hold, jumps = self._still > _STANDS, estimator.jumps
        late = self._late_std * (after.tau - before.tau) / (2.0 * period)
        if rows.noise is not None:
            self._shaken = rows.noise[0][:, :, PAYLOAD]
        extra = self._free.extra_variance(rows, estimator, front_end.passed)
        assert extra is not None
        extra = self._stays * extra + _shaken(self._shaken, *estimator.parts(PAYLOAD)[:2])
        estimate = estimator.update(np.column_stack([rows.Y, late]), rows.y, hold, extra, rows.considered)
        estimator.compensate(_with_late(rows.noise), hold, extra)
        if estimate.status == "not_finite":
            self._estimator = None
            self._begin()
            return False
        if estimator.jumps != jumps or estimator.misfits * period >= _UNEXPLAINED * front_end.memory:
            estimator.undo_misfits()
            estimator.forget()
            self._passing = _tail(front_end, rows.tau, estimator.row_variance)
        if estimator.noise_known:
            found = 0.5 * self._delay + self._late_std * float(estimator.theta[-1])
            self.lead += min(period / _TAKEN_OVER, 1.0) * (float(np.clip(found, 0.0, self._delay)) - self.lead)
        return True


def _tail(front_end: FrontEnd, torque: FloatArray, variance: FloatArray) -> float:
    """Time after which nothing is left in the rows of a change of torques of that size, shape (n,) [N m], that shows beside noise
    of this variance, shape (n,) [s]."""
    assert front_end.arm is not None
    bank = front_end.arm.bank
    above = float(np.max(np.abs(torque) / np.sqrt(variance)))
    # of the pole next to the imaginary axis of a Butterworth low-pass
    rate = 2.0 * math.pi * bank.cutoff_hz * math.sin(math.pi / (4.0 * len(bank.sections)))
    return max(math.log(above) / rate, 0.0) if above > 0.0 else 0.0


def _shaken(columns: FloatArray, theta: FloatArray, covariance: FloatArray) -> FloatArray:
    """Variance of rows by the noise of the accelerations that a payload is moved with, shape (n,) [(N m)^2].

    Args:
        columns: of the payload, a standard deviation of each acceleration in one, shape (n, n, 10). theta, covariance: of it.
    """
    return np.asarray(((columns @ (covariance + np.outer(theta, theta))) * columns).sum(axis=(0, 2)))


def _with_late(noise: Noise) -> Noise:
    """What the noise of the accelerations does to the rows with the column of the delay: nothing to that."""
    if noise is None:
        return None
    Y, tau, considered = noise
    return np.concatenate([Y, np.zeros((*Y.shape[:2], 1))], axis=2), tau, considered
