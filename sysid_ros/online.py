"""OnlineEstimation: from one measurement after the other to the payload.

The live node, the replay of a bag and a simulation all call the same :meth:`OnlineEstimation.step`; what is replayed is what ran.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sysid_ros import ground_contact
from sysid_ros.estimators import Estimate, Estimator, VariableForgetting
from sysid_ros.floating_base import floating_base_of
from sysid_ros.free_parameters import PAYLOAD, FreeParameters
from sysid_ros.front_end import FrontEnd, Rows
from sysid_ros.ground_contact import GroundContact
from sysid_ros.judgement import Judgement
from sysid_ros.model_file import ModelFile
from sysid_ros.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.payload_events import EventLog
from sysid_ros.physical_projection import project
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.settings import OnlineSettings
from sysid_ros.stance_log import StanceLog

_FIRST = 25
"""Measurements from which rate and noise of the torque are read before anything is estimated."""
_LONGEST_STEP = 1.0
"""Longest time between measurements while the rate is not known [s]."""
_SHORTEST_PERIOD = 5e-5
"""Measurements do not come faster, whatever their stamps say [s]."""
_CHECK_EVERY = 300
"""Measurements after which the rate is looked at again."""
_LONGEST_FILL = 10.5
"""Longest step that is interpolated over [periods]."""
_STANDS = 0.15
"""Time below the standstill velocity after which the robot stands [s]."""
_OBSERVABLE = 0.3
"""Part of a parameter's prior standard deviation below which it is the motion that determines it."""
_NOT_A_BODY = 29.6
"""99.9 % quantile of chi-squared with 10 degrees of freedom."""


class OnlineEstimation:
    """Estimates the payload on an arm: ``F(tau - tau_known) = F(Y_payload) theta + F(Y_friction) phi + noise``.

    A legged robot adds one step, see :class:`sysid_ros.contact_projection.ContactProjection`; standing still determines its
    payload's mass, so it is updated at rest too.

    F is one low-pass, the same on both sides. Filters are made for the rate that the first measurements show, and again after a
    gap or a jump of time; nothing is updated while the robot stands.

    Args:
        robot: the arm, or the legs of a floating base.
        settings: all that can be set.
        known: the identified model; without it the URDF's links and its ``<dynamics>`` are what is known.

    Attributes:
        base: the robot on its floating base, None for an arm. latest: the last estimate given out, or None.
        estimator: the recursion, once the first measurements are in.

    Raises:
        RobotModelError, ModelFileError, SettingsError: the frame, the model or a setting does not fit the robot.
    """

    def __init__(self, robot: RobotModel, settings: OnlineSettings, known: ModelFile | None = None) -> None:
        self.robot, self.settings = robot, settings
        self.base = floating_base_of(robot, settings)
        self._stances = StanceLog(self.base.contact_frames) if self.base else None
        self._outliers = 0
        self._free = FreeParameters(robot, settings, known, self.base)
        self._log = EventLog(settings.no_payload_mass)
        self._warnings = {note: note for note in known.notes(robot.urdf)} if known else {}
        self._tare = np.zeros(10), np.zeros((10, 10))
        self._observable_std = _OBSERVABLE * self._free.prior_std[PAYLOAD]
        self._enabled = True
        self.latest: PayloadEstimate | None = None
        self.estimator: Estimator | None = None
        self._judgement: Judgement | None = None
        self._floor: FloatArray = np.zeros(0)
        self._next_publish = -math.inf
        self._front_end: FrontEnd | None = None
        self._first: list[Measurement] = []
        self._last_t = -math.inf
        self._since_check, self._checked_t = 0, 0.0
        self._longest_step = math.inf
        self._still = 0.0
        self._ground = GroundContact(settings.sensor_timeout)

    @property
    def events(self) -> list[PayloadEvent]:
        """Picks, drops and other changes so far."""
        return self._log.events

    @property
    def warnings(self) -> list[str]:
        """What the user should know, one sentence or a few each."""
        return [*self._warnings.values(), *(self._stances.warnings if self._stances else ())]

    @property
    def stance_counts(self) -> dict[str, int]:
        """Of a floating base: samples by what was doubtful about its feet, and updates that did not fit the estimate
        ('outlier')."""
        return {} if self._stances is None else self._stances.counts | ({"outlier": self._outliers} if self._outliers else {})

    @property
    def frame(self) -> str:
        """Frame that the payload is expressed in."""
        return self._free.payload.frame

    @property
    def rate(self) -> float | None:
        """Measurements a second, once known [Hz]."""
        return self._front_end.rate if self._front_end else None

    def prior(self) -> PayloadEstimate:
        """What is known before any measurement: nothing but the prior."""
        n = self.robot.n
        return PayloadEstimate(
            t=0.0,
            frame=self.frame,
            theta=np.zeros(10),
            covariance=np.diag(self._free.prior_std[PAYLOAD] ** 2),
            status="warming_up",
            reason="There is no estimate yet.",
            observable=np.zeros(10, dtype=bool),
            residual=np.zeros(n),
            payload_effort=np.zeros(n),
        )

    def reset(self, reason: str) -> None:
        """Forget payload, friction and noise, and start again."""
        self.latest = self.estimator = self._judgement = None
        self._forget_filters()
        self._warnings["reset"] = f"The estimation was started again: {reason}."

    def set_enabled(self, enabled: bool) -> None:
        """Freeze the estimate (False) or go on (True)."""
        if enabled and not self._enabled:
            self._forget_filters()
        self._enabled = enabled

    def tare(self) -> str:
        """Take the present estimate as zero from now on, its covariance added to all that come. Says what was done."""
        if self.estimator is None or self.latest is None:
            return "There is no estimate yet, so nothing was tared."
        theta, covariance = self.estimator.theta[PAYLOAD], self.estimator.covariance()[PAYLOAD, PAYLOAD]
        self._tare = theta, covariance
        return f"Tared at {theta[0]:.3f} kg (std {math.sqrt(covariance[0, 0]):.3f} kg)."

    def step(self, measurement: Measurement) -> PayloadEstimate | None:
        """Take in one measurement; the estimate when one is due (``publish_rate``), else None. Never raises on a measurement."""
        if not self._enabled:
            return None
        if not 0.0 < measurement.t - self._last_t <= self._longest_step:
            self._forget_filters()
        self._last_t = measurement.t
        if self._front_end is not None:
            self._check_rate(self._front_end, measurement.t)
        if self._front_end is not None:
            return self._take(self._front_end, measurement)
        self._longest_step = _LONGEST_STEP
        self._first.append(measurement)
        if len(self._first) < _FIRST:
            return None
        first, self._first = self._first, []
        self._front_end = front_end = self._make_front_end(first)
        estimates = [self._take(front_end, m) for m in first]
        return next((e for e in reversed(estimates) if e is not None), None)

    def _check_rate(self, front_end: FrontEnd, t: float) -> None:
        """The first measurements may have come in a burst: filters made for another rate than there is are made again."""
        self._since_check += 1
        if self._since_check < _CHECK_EVERY:
            return
        faster = self._since_check / ((t - self._checked_t) * front_end.rate)
        self._since_check, self._checked_t = 0, t
        if not 0.6 < faster < 1.4:
            self._forget_filters()

    def _forget_filters(self) -> None:
        self._first = []
        self._front_end = None
        self._next_publish = -math.inf
        self._longest_step = math.inf
        self._still = 0.0

    def _make_front_end(self, measurements: list[Measurement]) -> FrontEnd:
        s = self.settings
        sample_period = max(float(np.median(np.diff([m.t for m in measurements]))), _SHORTEST_PERIOD)
        self._since_check, self._checked_t = 0, measurements[-1].t
        self._longest_step = max(min(s.max_gap, _LONGEST_FILL * sample_period), 3.5 * sample_period)
        front_end = FrontEnd(
            self._free.model, sample_period, s.update_rate, s.cutoff_hz, s.velocity_source == "message", self.base,
            s.standstill_velocity, self._stances,
        )  # fmt: skip
        if front_end.rate < 20.0:
            self._warnings["rate"] = (
                f"The joint states come at {front_end.rate:.1f} Hz; below 20 Hz the accelerations are lost. Publish them faster."
            )
        if self.estimator is None:
            self._floor = self._free.noise_density(measurements, sample_period) / front_end.period
            self.estimator = self._free.make_estimator(front_end, self._floor)
            self._make_judgement()
        return front_end

    def _make_judgement(self) -> None:
        self._judgement = Judgement(self.base.robot if self.base else self.robot, self.settings, self._floor)

    def _take(self, front_end: FrontEnd, measurement: Measurement) -> PayloadEstimate | None:
        published = None
        for rows in front_end.push(measurement):
            assert self.estimator is not None
            if not self._on_ground(rows, front_end):
                published = self._held(rows) or published
                continue
            estimate = self._update(rows, front_end, self.estimator)
            if estimate.status == "not_finite":
                self._forget_filters()
                return None
            if rows.sample.t >= self._next_publish:
                self._next_publish = max(self._next_publish, rows.sample.t - front_end.period) + 1.0 / self.settings.publish_rate
                published = self.latest = self._publish(estimate, rows, measurement.t, self.estimator)
        return published

    def _on_ground(self, rows: Rows, front_end: FrontEnd) -> bool:
        """Whether a row is used; False while the feet do not carry the robot, or it has just been set down."""
        state = self._ground.update(rows.trust, front_end.period)
        if state == ground_contact.STANDS_AGAIN:
            assert self.estimator is not None
            self.estimator.forget()
            self._make_judgement()
        return state in (ground_contact.STANDS, ground_contact.STANDS_AGAIN)

    def _held(self, rows: Rows) -> PayloadEstimate | None:
        """What is given out while the robot is lifted, when it is due: no claim."""
        if not self._ground.lifted or rows.sample.t < self._next_publish:
            return None
        self._next_publish = rows.sample.t + 1.0 / self.settings.publish_rate
        self.latest = replace(self.prior(), t=rows.sample.t, status="stale", reason=self._ground.reason)
        return self.latest

    def _update(self, rows: Rows, front_end: FrontEnd, estimator: Estimator) -> Estimate:
        stands = max(rows.speed.tolist()) < self.settings.standstill_velocity
        self._still = self._still + front_end.period if stands else 0.0
        hold = self._still > _STANDS and self.base is None
        known = isinstance(estimator, VariableForgetting) and estimator.noise.known
        jumps, before = _jumps(estimator), estimator.theta
        estimate = estimator.update(rows.Y, rows.y, hold, self._free.friction_variance(rows, before), rows.considered)
        self._outliers += estimate.status == "outlier"
        if not hold and self._judgement is not None:
            self._judgement.add(rows, rows.Y[:, PAYLOAD] @ estimate.theta[PAYLOAD], estimator)
        if known and _jumps(estimator) != jumps and isinstance(estimator, VariableForgetting):
            delay = front_end.delay + estimator.HITS * front_end.period
            mass = float(before[0] - self._tare[0][0])
            self._log.add(rows.sample.t - delay, mass, mass + float(estimator.last_jump[0]))
        return estimate

    def _publish(self, estimate: Estimate, rows: Rows, t: float, estimator: Estimator) -> PayloadEstimate:
        theta: FloatArray = estimate.theta[PAYLOAD] - self._tare[0]
        covariance = estimate.covariance[PAYLOAD, PAYLOAD] + self._tare[1]
        std = np.sqrt(covariance.diagonal())
        assert self._judgement is not None
        status, reason = self._judgement.status(estimate, estimator, float(theta[0]), float(std[0]))
        self._warnings.pop("inconsistent", None)
        if status == "inconsistent":
            self._warnings["inconsistent"] = reason
            self._log.clear()
        if status == "ok":
            theta, distance = project(theta, covariance)
            if not distance <= _NOT_A_BODY:
                status, reason = "not_physical", "No body of positive density has these parameters, whatever the noise."
        if status != "warming_up":
            self._log.refine(t, float(theta[0]))
        q, v = rows.sample.q, rows.sample.v
        effort = self._free.model.robot.payload_regressor(q, v, rows.acceleration, self._free.payload.frame_index) @ theta
        residual = rows.y - rows.Y @ estimate.theta
        if self._front_end is not None and self._front_end.projection is not None:
            legs = self._front_end.projection.leg_torque
            effort, residual = legs(effort[: residual.size]), legs(residual)
        return PayloadEstimate(
            t=t,
            frame=self.frame,
            theta=theta,
            covariance=covariance,
            status=status,
            reason=reason,
            observable=std < self._observable_std,
            residual=residual,
            payload_effort=effort,
        )


def _jumps(estimator: Estimator) -> int:
    return estimator.jumps if isinstance(estimator, VariableForgetting) else 0
