"""OnlineEstimation: from one measurement after the other to the payload. The live node, the replay of a bag and a simulation all call
the same :meth:`OnlineEstimation.step`; what is replayed is what ran.
"""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.effects import CoulombFriction, Effect, Payload, TorqueOffset, ViscousFriction
from sysid_ros.estimators import ConstantForgetting, Estimate, Estimator, JumpRule, VariableForgetting
from sysid_ros.front_end import FrontEnd, Rows, white_noise_variance
from sysid_ros.model_check import ModelCheck
from sysid_ros.model_file import ModelFile
from sysid_ros.payload_estimate import PayloadEstimate, PayloadEvent
from sysid_ros.payload_events import EventLog
from sysid_ros.physical_projection import project
from sysid_ros.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.settings import OnlineSettings
from sysid_ros.torque_model import TorqueModel

_FIRST = 25
"""Measurements from which rate and noise of the torque are read before anything is estimated."""
_NOT_A_BODY = 29.6
"""99.9 % quantile of chi-squared with 10 degrees of freedom."""


class OnlineEstimation:
    """Estimates the payload on a fixed-base arm: ``F(tau - tau_known) = F(Y_payload) theta + F(Y_friction) phi + noise``.

    Free are the payload's ten parameters and, beside them, what offset and friction of each joint differ from the known model. Filters
    are made for the rate that the first measurements show and again after a gap; nothing is updated while the robot stands.

    Args:
        robot: the arm.
        settings: all that can be set.
        known: the identified model; without it the URDF's links and its ``<dynamics>`` are what is known.

    Attributes:
        latest: the last estimate given out, or None.

    Raises:
        RobotModelError, ModelFileError: the frame or the model does not fit the robot.
    """

    def __init__(self, robot: RobotModel, settings: OnlineSettings, known: ModelFile | None = None) -> None:
        self.robot, self.settings = robot, settings
        self._payload = Payload(robot, frame=settings.frame_id)
        friction: list[Effect] = (
            [TorqueOffset(robot), CoulombFriction(robot), ViscousFriction(robot)] if settings.estimate_friction else []
        )
        known_effects = known.known_effects(robot) if known else []
        self.model = TorqueModel(robot, [self._payload, *friction], known_effects, links=settings.effort_type == "total")
        self._known = known
        self._coulomb = np.abs(self.model.known_theta("coulomb_friction"))
        self._viscous = np.abs(self.model.known_theta("viscous_friction"))
        self._prior_std = self._priors()
        self._log = EventLog(settings.no_payload_mass)
        self.latest: PayloadEstimate | None = None
        self._warnings = {note: note for note in known.notes(robot.urdf)} if known else {}
        self._tare: tuple[FloatArray, FloatArray] = np.zeros(10), np.zeros((10, 10))
        self._enabled = True
        self._forget_all()

    @property
    def events(self) -> list[PayloadEvent]:
        """Picks, drops and other changes so far."""
        return self._log.events

    @property
    def warnings(self) -> list[str]:
        """What the user should know, one sentence or a few each."""
        return list(self._warnings.values())

    @property
    def frame(self) -> str:
        """Frame that the payload is expressed in."""
        return self._payload.frame

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
            covariance=np.diag(self._prior_std[:10] ** 2),
            status="warming_up",
            reason="There is no estimate yet.",
            observable=np.zeros(10, dtype=bool),
            residual=np.zeros(n),
            payload_effort=np.zeros(n),
        )

    def reset(self, reason: str) -> None:
        """Forget payload, friction and noise, and start again."""
        self._forget_all()
        self.latest = None
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
        theta, covariance = self.estimator.theta[:10], self.estimator.covariance()[:10, :10]
        self._tare = theta, covariance
        return f"Tared at {theta[0]:.3f} kg (std {math.sqrt(covariance[0, 0]):.3f} kg)."

    def step(self, measurement: Measurement) -> PayloadEstimate | None:
        """Take in one measurement; the estimate when one is due (``publish_rate``), else None. Never raises on a measurement."""
        if not self._enabled:
            return None
        if not 0.0 < measurement.t - self._last_t <= self._longest_step:
            self._forget_filters()
        self._last_t = measurement.t
        self._longest_step = self.settings.max_gap
        if self._front_end is not None:
            return self._take(self._front_end, measurement)
        self._first.append(measurement)
        if len(self._first) < _FIRST:
            return None
        first, self._first = self._first, []
        self._front_end = front_end = self._make_front_end(first)
        estimates = [self._take(front_end, m) for m in first]
        return next((e for e in reversed(estimates) if e is not None), None)

    def _forget_all(self) -> None:
        self.estimator: Estimator | None = None
        self._check = ModelCheck(self.robot)
        self._updates = 0
        self._forget_filters()

    def _forget_filters(self) -> None:
        self._first: list[Measurement] = []
        self._front_end: FrontEnd | None = None
        self._last_t = -math.inf
        self._longest_step = math.inf
        self._still = 0.0

    def _priors(self) -> FloatArray:
        """Standard deviation of the free parameters before any data, shape (p,)."""
        s, n = self.settings, self.robot.n
        payload = [s.prior_mass_std] + [s.prior_first_moment_std] * 3 + [s.prior_inertia_std] * 6
        if not s.estimate_friction:
            return np.array(payload)
        if self._known is None:
            size = s.friction_unknown * np.where(np.isfinite(self.robot.effort_limit), self.robot.effort_limit, 50.0)
            return np.concatenate([payload, 0.2 * size, size, 2.0 * size])
        least = np.full(n, 0.1)
        drift = s.friction_drift
        return np.concatenate(
            [payload, 0.5 * drift * self._coulomb + least, drift * self._coulomb + least, drift * self._viscous + least]
        )

    def _make_front_end(self, measurements: list[Measurement]) -> FrontEnd:
        s = self.settings
        sample_period = float(np.median(np.diff([m.t for m in measurements])))
        front_end = FrontEnd(self.model, sample_period, s.update_rate, s.cutoff_hz, s.velocity_source == "message")
        self._publish_every = max(1, round(1.0 / (s.publish_rate * front_end.period)))
        if front_end.rate < 20.0:
            self._warnings["rate"] = (
                f"The joint states come at {front_end.rate:.1f} Hz; below 20 Hz the accelerations are lost. Publish them faster."
            )
        if self.estimator is None:
            self._floor = self._noise_density(measurements, sample_period) / front_end.period
            self.estimator = self._make_estimator(front_end)
        return front_end

    def _noise_density(self, measurements: list[Measurement], sample_period: float) -> FloatArray:
        """Least spectral density of the torque noise, shape (n,) [(N m)^2 s]: what was set, else white noise seen or the model's error."""
        if self.settings.torque_std:
            return np.broadcast_to(np.array(self.settings.torque_std), (self.robot.n,)) ** 2 * sample_period
        density = np.maximum(white_noise_variance(measurements), 1e-8) * sample_period
        if self._known is not None:
            density = np.maximum(density, 2.0 * self._known.torque_std**2 * self._known.correlation_time)
        return density

    def _make_estimator(self, front_end: FrontEnd) -> Estimator:
        s, period = self.settings, front_end.period
        if s.estimator == "constant":
            return ConstantForgetting(self._prior_std, self._floor, math.exp(-period / s.forgetting_time))
        least = np.full(10, np.inf)
        least[0], least[1:4] = 0.03, 5e-3
        return VariableForgetting(
            self._prior_std, self._floor, period, s.forgetting_time, JumpRule(slice(0, 10), least, front_end.memory)
        )

    def _take(self, front_end: FrontEnd, measurement: Measurement) -> PayloadEstimate | None:
        rows = front_end.push(measurement)
        if rows is None:
            return None
        estimate = self._update(rows, front_end)
        self._updates += 1
        if self._updates % self._publish_every:
            return None
        self.latest = self._publish(estimate, rows, measurement.t)
        return self.latest

    def _update(self, rows: Rows, front_end: FrontEnd) -> Estimate:
        assert self.estimator is not None
        fastest = float(rows.speed.max())
        self._still = self._still + front_end.period if fastest < self.settings.standstill_velocity else 0.0
        hold = self._still > 0.15
        jumps, before = self._jumps(), self.estimator.theta[:10]
        estimate = self.estimator.update(rows.Y, rows.y, hold, self._friction_variance(rows, fastest))
        if not hold and (not isinstance(self.estimator, VariableForgetting) or self.estimator.noise.known):
            self._check.add(rows.tau, rows.y - rows.Y[:, :10] @ estimate.theta[:10])
        if self._jumps() != jumps and isinstance(self.estimator, VariableForgetting):
            delay = front_end.delay + VariableForgetting.HITS * front_end.period
            mass = float(before[0] - self._tare[0][0])
            self._log.add(rows.sample.t - delay, mass, mass + float(self.estimator.last_jump[0]))
        return estimate

    def _jumps(self) -> int:
        return self.estimator.jumps if isinstance(self.estimator, VariableForgetting) else 0

    def _friction_variance(self, rows: Rows, fastest: float) -> FloatArray:
        """Variance of the torque that may hide in dry friction near standstill, where no model holds, shape (n,) [(N m)^2]."""
        extra: FloatArray = (0.5 * self._coulomb * np.clip(1.0 - rows.speed / 0.06, 0.0, 1.0)) ** 2
        if fastest < self.settings.low_velocity:
            extra += self.settings.stiction**2
        return extra

    def _publish(self, estimate: Estimate, rows: Rows, t: float) -> PayloadEstimate:
        assert self.estimator is not None
        full = self.estimator.covariance()
        theta = estimate.theta[:10] - self._tare[0]
        covariance = full[:10, :10] + self._tare[1]
        std = np.sqrt(np.diag(covariance))
        status, reason = self._judge(estimate, theta, std)
        if status in ("ok", "not_excited"):
            theta, distance = project(theta, covariance)
            if distance > _NOT_A_BODY and status == "ok":
                status, reason = "not_physical", "No body of positive density has these parameters, whatever the noise."
        if status != "warming_up":
            self._log.refine(t, float(theta[0]))
        sample = rows.sample
        effort = self.robot.payload_regressor(sample.q, sample.v, rows.acceleration, self._payload.frame_index) @ theta
        return PayloadEstimate(
            t=t,
            frame=self.frame,
            theta=theta,
            covariance=covariance,
            status=status,
            reason=reason,
            observable=std < 0.3 * self._prior_std[:10],
            residual=rows.y - rows.Y @ estimate.theta,
            payload_effort=effort,
        )

    def _judge(self, estimate: Estimate, theta: FloatArray, std: FloatArray) -> tuple[str, str]:
        s = self.settings
        if estimate.status == "warming_up":
            return "warming_up", f"{estimate.reason[0].upper()}{estimate.reason[1:]}. Keep moving."
        if isinstance(self.estimator, VariableForgetting):
            if not self.estimator.noise.known:
                return "warming_up", "The noise of the torques is not known yet. Keep moving."
            wrong = self._check.verdict(self.estimator.noise.variance, self._floor)
            self._warnings.pop("inconsistent", None)
            if wrong:
                self._warnings["inconsistent"] = wrong
                self._log.clear()
                return "inconsistent", wrong
        mass, mass_std = float(theta[0]), float(std[0])
        if mass_std > max(s.mass_std_limit, 0.05 * abs(mass)):
            if estimate.status == "not_excited":
                return (
                    "not_excited",
                    f"The robot stands; the mass is known to {mass_std:.2g} kg only. Move the joints that carry it.",
                )
            return "warming_up", f"The mass is known to {mass_std:.2g} kg only. Keep moving."
        if abs(mass) < max(s.no_payload_mass, 1.96 * mass_std):
            return "no_payload", f"No payload above {max(s.no_payload_mass, 1.96 * mass_std):.2g} kg."
        return "ok", f"{estimate.reason[0].upper()}{estimate.reason[1:]}." if estimate.reason else ""
