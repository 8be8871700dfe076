"""OnlineEstimation: from one measurement after the other to the payload.

The live node, the replay of a bag and a simulation all call the same :meth:`OnlineEstimation.step`; what is replayed is what ran.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sysid_ros.estimators import Estimate, Estimator, kernels
from sysid_ros.floating.contact_projection import ContactProjection
from sysid_ros.floating.floating_base import floating_base_of
from sysid_ros.floating.stance_log import STANDS, STANDS_AGAIN, GroundContact, StanceLog
from sysid_ros.online.arm_rows import Cadence
from sysid_ros.online.change_watch import ChangeWatch
from sysid_ros.online.free_parameters import PAYLOAD, FreeParameters
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.online.imu_doubts import name_imu
from sysid_ros.online.payload_estimate import ALL_OF_IT, NOT_A_BODY, Judgement, PayloadEstimate, PayloadEvent, nearest_body
from sysid_ros.online.payload_events import EventLog
from sysid_ros.online.rows import Rows
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray, Measurement
from sysid_ros.signals.cutoff import position_noise
from sysid_ros.torque.model_file import ModelFile

_STANDS = 0.15
"""Time below the standstill velocity after which the robot stands [s]."""
_OBSERVABLE = 0.3
"""Part of a parameter's prior standard deviation below which it is the motion that determines it."""


class OnlineEstimation:
    """Estimates the payload on an arm: ``F(tau - tau_known) = F(Y_payload) theta + F(Y_friction) phi + noise``.

    A legged robot adds one step, see :class:`.contact_projection.ContactProjection`; it is updated at rest too.

    F is one low-pass, the same on both sides. Filters are made for the rate that the first measurements show, and again after a
    gap or a jump of time; nothing is updated while the robot stands.

    Args:
        robot: the arm, or the legs of a floating base.
        settings: all that can be set.
        known: the identified model; without it the URDF's links and its ``<dynamics>`` are what is known.

    Attributes:
        base: the robot on its floating base, None for an arm. latest: the last estimate given out, or None.
        frame: that the payload is expressed in. estimator: the recursion, once there is one. fault: why it began anew.

    Raises:
        RobotModelError, ModelFileError, SettingsError: the frame, the model or a setting does not fit the robot.
    """

    def __init__(self, robot: RobotModel, settings: OnlineSettings, known: ModelFile | None = None) -> None:
        self.robot, self.settings = robot, settings
        self.base = floating_base_of(robot, settings)
        self._gravity = math.hypot(*settings.gravity)
        about = self._gravity, settings.accelerometer_bias_std > 0.0
        self._stances = StanceLog(self.base.contact_frames, *about, self.base.mass) if self.base else None
        self._outliers, self.fault = 0, ""
        own = robot if self.base else robot.with_links(np.zeros(10 * robot.n))  # its gravity may be turned
        self._free = FreeParameters(own, settings, known, self.base)
        self.frame = self._free.payload.frame
        self._log = EventLog(settings.no_payload_mass)
        notes = (*(known.notes(robot.urdf) if known else ()), *(self.base.notes if self.base else ()))
        self._warnings = {note: note for note in notes}
        self._changes = ChangeWatch(self._free, self._log)
        self._observable_variance = (_OBSERVABLE * self._free.prior_std[PAYLOAD]) ** 2
        self._enabled, self._next_publish = True, -math.inf
        self.latest: PayloadEstimate | None = None
        self.estimator: Estimator | None = None
        self._judgement: Judgement | None = None
        self._floor: FloatArray = np.zeros(0)
        self._front_end: FrontEnd | None = None
        self._noise: float | None = None
        self._spikes, self._still = 0, 0.0
        self._cadence = Cadence(settings.max_gap, 0 if self.base else robot.n)
        self._ground = GroundContact(settings.sensor_timeout, self._stances) if self._stances else None
        self._set_down: float | None = None

    @property
    def events(self) -> list[PayloadEvent]:
        """Picks, drops and other changes so far."""
        return self._log.events

    @property
    def warnings(self) -> list[str]:
        """What the user should know, one sentence or a few each."""
        spikes = self._spikes + (self._front_end.derivative.spikes if self._front_end else 0)
        said = f"{spikes} torques fitted neither the one before nor the one after; the middle of these was taken instead."
        told = [sentence for key, sentence in self._warnings.items() if key != "tilt" or "inconsistent" not in self._warnings]
        return [*told, *([said] if spikes else ()), *self._cadence.in_words, *(self._stances.warnings if self._stances else ())]

    @property
    def stance_counts(self) -> dict[str, int]:
        """Of a floating base: samples by what was doubtful about its feet, and updates that did not fit ('outlier')."""
        return {} if self._stances is None else self._stances.counts | ({"outlier": self._outliers} if self._outliers else {})

    @property
    def rate(self) -> float | None:
        """Measurements a second, once known [Hz]."""
        return self._front_end.rate if self._front_end else None

    def prior(self) -> PayloadEstimate:
        """What is known before any measurement: nothing but the prior."""
        return PayloadEstimate.unknown(self.frame, self._free.prior_std[PAYLOAD], self.robot.n)

    def reset(self, reason: str) -> None:
        """Forget payload, friction and noise, and start again."""
        self.latest = self.estimator = self._judgement = self._changes.trial = None
        self._changes.rows_so_far.clear()
        self._forget_filters()
        self._warnings["reset"] = f"The estimation was started again: {reason}."

    def set_enabled(self, enabled: bool) -> None:
        """Freeze the estimate (False) or go on (True)."""
        if enabled and not self._enabled:
            self._forget_filters()
        self._enabled = enabled

    def tare(self) -> str:
        """Take what is carried as nothing from now on, and learn what is known wrongly of the arm. Says what was done."""
        if self.estimator is None or self.latest is None:
            return "There is no estimate yet, so nothing was tared."
        self.estimator, (mass, std) = self._changes.take_tare(self.estimator, self._front_end, self._floor)
        return f"Tared at {mass:.3f} kg (std {std:.3f} kg)."

    def step(self, measurement: Measurement) -> PayloadEstimate | None:
        """Take in one measurement; the estimate when one is due (``publish_rate``), else None. Never raises on a measurement."""
        if not self._enabled:
            return None
        if not self._cadence.follows(measurement.t):
            self._forget_filters()
        known = self._cadence.take(measurement)
        anew = self._cadence.turned and self._changes.unlearn(self.estimator)
        if known and self._front_end is None:
            self._front_end = self._make_front_end(known)
        elif self._front_end is not None and (arm := self._front_end.arm) is not None and (anew or arm.too_fast):
            self._noise = arm.noise
            self._spikes += self._front_end.derivative.spikes
            self._front_end = self._make_front_end(known)
        published = None
        for m in known:
            for rows in self._front_end.push(m) if self._front_end is not None else ():
                published = self._take(rows, m.t) or published
        return published

    def _forget_filters(self) -> None:
        self._spikes += self._front_end.derivative.spikes if self._front_end else 0
        self._cadence.restart()
        self._front_end = None
        self._next_publish = -math.inf
        self._still = 0.0

    def _make_front_end(self, measurements: list[Measurement]) -> FrontEnd:
        s = self.settings
        noise = position_noise(np.array([m.q for m in measurements])) if self._noise is None else self._noise
        front_end = FrontEnd(
            self._free.model, self._cadence.period, s.update_rate, s.cutoff_hz, s.velocity_source == "message", self.base,
            s.standstill_velocity, self._stances, self._gravity, self._free.bias, noise, self._free.legs,
        )  # fmt: skip
        if front_end.rate < 20.0:
            said = f"The joint states come at {front_end.rate:.1f} Hz; below 20 Hz the accelerations are lost."
            self._warnings["rate"] = f"{said} Publish them faster."
        if self.estimator is None:
            self._floor = self._free.noise_density(measurements, self._cadence.period) / front_end.period
            self.estimator = self._free.make_estimator(front_end, self._floor)
            self._make_judgement()
        if front_end.projection is not None and self._free.trunk_noise is not None:
            front_end.projection.weigh(*self._free.trunk_noise)
        return front_end

    def _make_judgement(self) -> None:
        robot, floor = (self.base.robot, self._floor[:FREE]) if self.base else (self.robot, self._floor)
        self._changes.evidence = self._free.evidence()
        self._judgement = Judgement(robot, self.settings, floor, self._free.least_mass, self._changes.evidence)

    def _take(self, rows: Rows, t: float) -> PayloadEstimate | None:
        """One update, and what it gives if that is due; ``t``: stamp of the newest measurement [s]."""
        front_end, estimator, judgement = self._front_end, self.estimator, self._judgement
        if front_end is None or estimator is None or judgement is None:  # the filters have just been forgotten
            return None
        due = rows.t >= self._next_publish
        if self._ground is not None and not self._on_ground(rows, front_end, self._ground):
            return self._held(rows, self._ground) if due and self._ground.lifted else None
        fastest, friction, legs = max(rows.speed.tolist()), self._free.friction, self._free.legs
        self._still = self._still + front_end.period if fastest < self.settings.standstill_velocity else 0.0
        hold = self._still > _STANDS and self.base is None
        if legs is not None:
            self._free.carry(estimator)
        if self._free.tilt is not None and self._free.tilt.told:
            self._free.tilt.load = estimator.theta[PAYLOAD]
        if self._changes.trial is not None:
            estimator, estimate = self._changes.take_on_trial(rows, hold, estimator, front_end, self._changes.trial)
            self.estimator = estimator
        else:
            known, jumps, extra = estimator.noise_known, estimator.jumps, None
            if rows.fresh:
                extra = self._free.extra_variance(rows, estimator, front_end.passed)
            elif friction is not None:  # the same in fewer steps
                extra = friction.hidden_variance(rows.slow, rows.speed, *estimator.marginal(self._free.friction_slice))
            estimate = estimator.update(rows.Y, rows.y, hold, extra, rows.considered)
            estimator.compensate(rows.noise, hold, extra)
            told = self.latest is not None and self.latest.status == "ok"
            about = estimator, front_end, estimate, estimator.jumps != jumps, known, told
            estimate = self._changes.watch(rows, hold, extra, *about)
        self._outliers += estimate.status == "outlier"
        quiet = hold or (friction is not None and fastest < self.settings.low_velocity)
        if quiet or self._changes.standstill.lasts:
            self._changes.stand(rows, quiet, estimator, front_end)
        if judgement.evidence is None and not hold and estimator.noise_known:
            judgement.check.add(rows.tau, rows.Y, rows.y, estimate.theta[PAYLOAD])
        if estimate.status == "not_finite":
            self._forget_filters()
            self.fault = f"The estimation was no longer finite at {t:.3f} s: {estimate.reason}."
            return None
        if not due:
            return None
        self._next_publish = max(self._next_publish, rows.t - front_end.period) + 1.0 / self.settings.publish_rate
        self.latest = published = self._publish(estimate, rows, t, judgement, front_end.projection)
        if legs and self._changes.trial is None and estimate.status == "ok" and (why := legs.settle(estimator)):
            self.reset(why)
        return published

    def _on_ground(self, rows: Rows, front_end: FrontEnd, ground: GroundContact) -> bool:
        """Whether a row is used; False while the feet do not carry the robot, or it has just been set down."""
        lifted = ground.lifted
        state = ground.update(rows.trust, front_end.period)
        if ground.lifted and not lifted:
            self._log.lift(rows.t - ground.seconds)
        if state == STANDS_AGAIN:
            assert self.estimator is not None
            self._set_down = rows.t - ground.seconds
            self.estimator.forget()
            self._make_judgement()
        return state in (STANDS, STANDS_AGAIN)

    def _held(self, rows: Rows, ground: GroundContact) -> PayloadEstimate:
        """What is given out while the robot is lifted: no claim."""
        self._next_publish = rows.t + 1.0 / self.settings.publish_rate
        self.latest = replace(self.prior(), t=rows.t, status="stale", reason=ground.reason)
        return self.latest

    def _publish(
        self, estimate: Estimate, rows: Rows, t: float, judgement: Judgement, projection: ContactProjection | None
    ) -> PayloadEstimate:
        assert self.estimator is not None
        front_end = self._front_end if self.base is not None else None
        repeated = self._free.repeated_covariance(self.estimator, front_end, self._floor) if front_end is not None else None
        if self._changes.tare.taken or repeated is not None:
            theta, noise, model = self._changes.tare.tared(self.estimator, repeated)
            covariance, parts = noise + model, ALL_OF_IT
        else:
            theta, noise, sensitivity = self.estimator.parts(PAYLOAD)
            covariance, parts = judgement.with_errors(noise, sensitivity, self._free.gained)
        held = self.base.mass if self.base is not None and not self._changes.tare.taken else 0.0
        if self._stances is not None:
            covariance[0, 0] += self._stances.mass_error(held + max(float(theta[0]), 0.0)) ** 2
        mass_std = float(covariance[0, 0] ** 0.5)
        fits = self.estimator.noise_known and self._changes.trial is None and estimate.status == "ok"
        asked = fits and self._free.tilt_is_open
        turned = self._free.settle_tilt(self.estimator, judgement.with_errors) if asked else None
        if turned is not None and self._front_end is not None:
            self._front_end.rest()
            self._changes.rows_so_far.clear()
            if judgement.evidence is not None:
                judgement.evidence.turn(turned)
        if asked and self._free.tilt is not None and self._free.tilt.told:
            self._warnings["tilt"] = self._free.tilt.told
        status, reason = judgement.status(estimate, self.estimator, float(theta[0]), mass_std, parts)
        inconsistent = status == "inconsistent"
        if self._changes.trial is not None or self._changes.standstill.told:
            status, reason = self._changes.status(t, status, reason)
        if status == "ok":
            theta, distance = nearest_body(theta, noise, covariance)
            if not distance <= NOT_A_BODY:
                status, reason = "not_physical", "No body of positive density has these parameters, whatever the noise."
        if self._free.legs is not None and self._stances is not None:
            doubt = self._stances.mass_error(held) / mass_std
            reason = name_imu(self._free.legs, self._stances, self.estimator, status, reason, doubt, self._warnings)
        self._warnings.pop("inconsistent", None)
        if inconsistent:
            self._warnings["inconsistent"] = reason
        if status != "warming_up" and (self.base is not None or t <= self._log.open_until):
            self._log.refine(t, float(theta[0]))
        if self._set_down is not None and status in ("ok", "no_payload"):
            self._log.set_down(self._set_down, float(theta[0]), mass_std)
            self._set_down = None
        residual = np.empty(rows.y.size)
        kernels.innovate(rows.Y, rows.y, estimate.theta, residual)
        effort = self._free.payload_torque(rows.q, rows.v, rows.acceleration, theta)
        if projection is not None:
            effort = projection.leg_torque(effort[:FREE])
            residual = projection.leg_torque(projection.wrench(residual[:FREE]))
        observable = covariance.diagonal() < self._observable_variance
        return PayloadEstimate(t, self.frame, theta, covariance, status, reason, observable, residual, effort)
