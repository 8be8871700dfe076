"""FreeParameters: what the online estimation does not know, how little it knows of it, and the estimator made for that."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from sysid_ros.effects import Effect, Payload
from sysid_ros.estimators import Estimator, JumpRule, Problem, make_estimator
from sysid_ros.exceptions import RobotModelError, SettingsError
from sysid_ros.floating.contact_projection import ContactProjection
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.stance_log import STEP
from sysid_ros.online.friction_correction import FrictionCorrection
from sysid_ros.online.front_end import FrontEnd
from sysid_ros.online.leg_parameters import LegParameters
from sysid_ros.online.model_evidence import BY_LOAD, ROTOR, ModelEvidence
from sysid_ros.online.rows import Rows
from sysid_ros.online.small_tilt import SmallTilt
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.body_torque import BodyTorque
from sysid_ros.robot.link_inexactness import link_inexactness
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FREE, FloatArray, Measurement, Sample
from sysid_ros.torque.model_file import ModelFile
from sysid_ros.torque.torque_model import TorqueModel

PAYLOAD = slice(0, 10)
"""Where the payload's ten parameters stand among the free ones."""

LEAST_JUMP = (0.03, 5e-3, 5e-3, 5e-3) + (math.inf,) * 6
"""Change of mass [kg] or first moment [kg m] of which one must be exceeded to count as a change of the payload."""
_STAYS = 0.5
"""For so long dry friction at standstill is wrong by the same torque [s]."""
_LEVEL = 1e-4
"""What a base is tilted by that is level, as a part of the prior standard deviation."""
_CARRIED = 0.16
"""Least prior standard deviation of what a robot on legs carries, as a part of its own mass."""
_SIZE = 0.11
"""Its distance from the trunk's origin over the cube root of the robot's mass [m/kg^(1/3)]: a quarter of a metre on 12 kg."""
_OF_ROBOT = 0.03
"""Part of its own mass that what a robot on legs carries need not be known better to."""
_GRAVITY_DENSITY = 1e-8
"""Least density of the noise with which the accelerometer shows gravity [(m/s^2)^2 s]."""


WithErrors = Callable[[FloatArray, FloatArray, int], tuple[FloatArray, tuple[float, float]]]
"""As :meth:`.Judgement.with_errors`: from noise, sensitivity and how many errors are of gains to the covariance, and more."""


class FreeParameters:
    """The payload's ten parameters and, beside them, what offset and friction of each joint differ from the known model.

    Args:
        robot: the arm, or the legs of a floating base. settings: prior and noise. known: the identified model, if any.
        base: the robot where it floats; the torques of its legs are then not distinguishable from friction, which is as known.

    Attributes:
        payload: the effect whose columns come first. payload_torque: what a payload costs the joints. bias: where that of the
            accelerometer stands, None where it is not free.
        tilt: of an arm's base, where it is free. tilt_slice: where its two parameters stand. tilt_is_open: whether that is to be
            asked still. friction_slice: where those of friction stand.
        legs: what is not known of a robot on legs beside its payload, None of an arm.
        friction: of an arm; its parameters, if they are free, come after the payload's. None of a floating base.
        model: known and free effects. gained: how many of its considered errors, the last ones, are of the efforts' gains.
        extra_colour: as of :class:`.Problem`, of the estimator that was made last.
        trunk_noise: of a floating base, once :meth:`noise_density` has run: density of the noise of the legs' torques, shape
            (n,), and what the six rows have beside, shape (6,).
        prior_std: standard deviation of the free parameters before any data, shape (p,).

    Raises:
        SettingsError: ``torque_std`` does not fit the robot.
    """

    def __init__(
        self, robot: RobotModel, settings: OnlineSettings, known: ModelFile | None, base: FloatingBase | None = None
    ) -> None:
        self._robot, self._settings, self._known, self._base = robot, settings, known, base
        if len(settings.torque_std) not in (0, 1, robot.n):
            raise SettingsError(
                f"torque_std has {len(settings.torque_std)} values; it must have one for all joints or {robot.n}, "
                f"one for each of {', '.join(robot.joint_names)}."
            )
        whole = base.robot if base else robot
        self.payload = Payload(whole, frame=settings.frame_id or (base.trunk if base else robot.flange))
        self.payload_torque = BodyTorque(whole, self.payload.frame_index)
        if known is None and not np.any(whole.pi):
            raise RobotModelError(
                f"no link of the URDF '{robot.name}' that moves has a mass, so that all of it would be payload. Give a URDF with "
                "<inertial>, or what 'sysid identify' found as the model (--model, model_path)."
            )
        known_effects = known.known_effects(whole) if known and not base else None
        uncertainty = known.uncertainty if known else None
        if known and base:
            known_effects, uncertainty, *setup = known.on_legs(whole)
            base.set_up(*setup)
        self.friction = None if base else FrictionCorrection(robot, settings, known_effects)
        effects: list[Effect] = [self.payload]
        prior_std = [self._payload_prior()]
        if self.friction is not None and settings.estimate_friction:
            effects.append(self.friction)
            prior_std.append(self.friction.expected_std)
        self.tilt: SmallTilt | None = None
        if base is None and settings.effort_type == "total" and settings.base_tilt_std > 0.0 and np.any(robot.gravity):
            self.tilt = SmallTilt(robot, settings.base_tilt_std, self.payload.frame_index)
            effects.append(self.tilt)
            prior_std.append(np.full(2, settings.base_tilt_std))
        self.extra_colour = 1.0
        self.trunk_noise: tuple[FloatArray, FloatArray] | None = None
        self.legs = LegParameters(base, self.payload.frame, settings, known_effects) if base else None
        if self.legs is not None:
            effects += self.legs.effects
            prior_std.append(self.legs.prior_std)
        inexact, gain = None, 0.0
        if known is None and settings.effort_type == "total":
            gain = 0.0 if base else settings.effort_gain_error
            inexact = link_inexactness(whole, settings.link_mass_error, settings.link_com_error, base is not None)
        self.model = TorqueModel(
            whole,
            effects,
            known_effects or [],
            settings.effort_type == "total",
            uncertainty,
            inexact=inexact,
            gain=gain,
        )
        self.tilt_is_open, self.gained = self.tilt is not None, self.model.error.gained
        self.bias = self.legs.bias if self.legs else None
        self.tilt_slice = self.model.slices[effects.index(self.tilt)] if self.tilt else slice(0, 0)
        self.friction_slice = self.model.slices[1] if self.friction in effects else slice(0, 0)
        self.prior_std = np.concatenate(prior_std)

    def evidence(self) -> ModelEvidence | None:
        """Takes in rows to tell by how much the model of an arm is wrong; None where efforts do not hold what it weighs."""
        s, n = self._settings, self._robot.n
        if self.friction is None or s.effort_type != "total":
            return None
        shared = np.concatenate([self.prior_std[PAYLOAD], self.prior_std[self.tilt_slice]])
        own = self.friction.unknown_std().reshape(3, n)  # whatever a model knows of it may have drifted
        own = np.vstack([own, ROTOR * own[1], own[1], np.full(n, BY_LOAD)])
        return ModelEvidence(n, 1.0 / s.update_rate, shared, own, s.effort_gain_error, self._known is None)

    def _payload_prior(self) -> FloatArray:
        prior = self._settings.payload_prior
        if self._base is None:
            return prior
        mass, size = _CARRIED * self._base.mass, _SIZE * self._base.mass ** (1.0 / 3.0)
        least = np.array([mass] + [mass * size] * 3 + [mass * size**2] * 6)
        return np.asarray(np.maximum(prior, least))

    def settle_tilt(self, estimator: Estimator, with_errors: WithErrors) -> FloatArray | None:
        """Ask whether the base is tilted; the two angles [rad] by which gravity was turned because it is, so that rows of before
        do not hold, else None. Not to be asked once it is known to be level, see ``tilt_is_open``. ``with_errors``: as
        :meth:`.Judgement.with_errors`."""
        assert self.tilt is not None
        where = self.tilt_slice
        theta, noise, sensitivity = estimator.parts(where)
        found = bool(self.tilt.told)
        turned = self.tilt.settle(theta, with_errors(noise, sensitivity, self.gained)[0], noise)
        if turned:
            estimator.shift(where, -theta)
            if not found:  # what is carried was learned as heavy in another direction
                estimator.forget()
        if self.tilt.level:
            estimator.fix(where, _LEVEL * self._settings.base_tilt_std)
            self.model.leave_out(self.tilt)
            self.tilt_is_open = False
        return theta if turned else None

    def carry(self, estimator: Estimator) -> None:
        """Take in what is known of the free parameters of a robot on legs now."""
        assert self.legs is not None
        theta, variance = estimator.marginal(slice(0, self.model.p))
        self.legs.carry(theta[PAYLOAD].copy())
        self.legs.know(theta, variance)

    def repeated_covariance(self, estimator: Estimator, front_end: FrontEnd, floor: FloatArray) -> FloatArray:
        """What every step of a robot on legs repeats makes of the payload's covariance, shape (10, 10); nothing of an arm's.

        The white noise of the sensors is new in every step. What single rows show beside it, of impacts and of what the model has
        not, is the same in the next step: it is no better known from many than from one. A robot that stands or sways takes none,
        and its motion does not return as it was. ``floor``: as of :meth:`noise_density`, of the rows.
        """
        if self._base is None or not estimator.noise_known or front_end.stepping == 0.0:
            return np.zeros((10, 10))
        density = np.maximum(estimator.row_variance / front_end.passed - floor, 0.0)
        density[FREE:] = 0.0
        return estimator.repeated_covariance(PAYLOAD, density, STEP / (front_end.stepping * front_end.period))

    def extra_variance(self, rows: Rows, estimator: Estimator, passed: float) -> FloatArray | None:
        """Variance of the rows beside their noise, shape (n,): what dry friction hides; and of rows soon after a change as if
        what single rows show were white, because noise whose long-run variance is small cancels only in the long run.

        Args:
            estimator: that takes them in. passed: as of :class:`.FrontEnd`.
        """
        extra = self.hidden_variance(rows, estimator)
        if extra is not None and rows.fresh and estimator.noise_known:
            extra += np.maximum(estimator.row_variance / passed - estimator.noise_variance, 0.0) / self.extra_colour
        return extra

    def hidden_variance(self, rows: Rows, estimator: Estimator) -> FloatArray | None:
        """Variance of what dry friction hides of the rows, shape (n,); None of a floating base."""
        if self.friction is None:
            return None
        return self.friction.hidden_variance(rows.slow, rows.speed, *estimator.marginal(self.friction_slice))

    def noise_density(self, measurements: list[Measurement], sample_period: float) -> FloatArray:
        """Least spectral density of the torque noise, shape (n,) [(N m)^2 s].

        What was set; else the white noise that the measurements show or, if that is more, the error that the known model states.
        """
        if self._settings.torque_std:
            std: FloatArray = np.broadcast_to(np.array(self._settings.torque_std), (self._robot.n,))
            density = std**2 * sample_period
        else:
            density = np.maximum(white_noise_variance(measurements), 1e-8) * sample_period
            if self._known is not None:
                density = np.maximum(density, self._known.error_density(self._robot))
        return density if self._base is None else self._of_trunk(self._base, measurements, density, sample_period)

    def _of_trunk(
        self, base: FloatingBase, measurements: list[Measurement], density: FloatArray, sample_period: float
    ) -> FloatArray:
        """As :meth:`noise_density`, of the rows of a floating base: from the torques of the legs, shape (n,), and the noise of
        the accelerometer times the robot's mass; that of the accelerometer itself where its bias is free."""
        first = next(m for m in measurements if m.trunk is not None)
        assert first.trunk is not None
        zero = np.zeros(self._robot.n)
        state = base.state(first.q, zero, zero, np.zeros(3), first.trunk.force, np.zeros(3))
        force = np.array([m.trunk.force for m in measurements if m.trunk is not None])
        felt = white_variance(force) * sample_period
        beside = np.append(base.mass**2 * felt, np.zeros(3))
        self.trunk_noise = density.copy(), beside
        rows = ContactProjection(base).variance_at(Sample(first.t, *state, np.zeros(base.robot.n)), density, beside)
        return np.append(rows, np.max(felt) + _GRAVITY_DENSITY) if self.bias is not None else rows

    def make_estimator(self, front_end: FrontEnd, floor: FloatArray) -> Estimator:
        """The estimator that the settings name, for rows of at least the variance ``floor``, shape (n,)."""
        self.extra_colour = 1.0 if self._base else max(_STAYS / front_end.period, 1.0)
        if self.tilt is not None:  # nothing is known of it any more
            self.tilt.level, self.tilt_is_open = False, True
            self.model.leave_out()
        return self.make_again(front_end, floor)

    def make_again(self, front_end: FrontEnd, floor: FloatArray, considered: int = 0) -> Estimator:
        """Such an estimator, which knows whether the base is tilted; so many considered errors are parameters behind its own."""
        s, prior_std = self._settings, np.append(self.prior_std, np.ones(considered))
        # an arm's rows are made anew after a change, see RowHistory
        jump = JumpRule(PAYLOAD, np.array(LEAST_JUMP), front_end.memory if self._base else 0.0, STEP if self._base else 0.0)
        part = 1.0 if self._base is None else front_end.passed
        problem = Problem(prior_std, floor, front_end.period, s.forgetting_time, jump, part, self.extra_colour)
        estimator = make_estimator(s.estimator, problem)
        if self.tilt is not None and self.tilt.level:
            estimator.fix(self.tilt_slice, _LEVEL * s.base_tilt_std)
        return estimator

    @property
    def links_are_of_the_urdf(self) -> bool:
        """True of an arm whose links are known from the URDF alone."""
        return self._known is None and self._base is None and self._settings.effort_type == "total"

    @property
    def empty(self) -> float:
        """Mass below which there is no payload [kg]."""
        return self._settings.no_payload_mass

    @property
    def least_mass(self) -> float:
        """What the payload's mass need not be known better to [kg]: legs hold the robot, too."""
        return _OF_ROBOT * self._base.mass if self._base else 0.0

    def error_directions(self) -> FloatArray:
        """What a payload and the considered errors are in the links' inertials, shape (10 n, 10 + d): nothing of the efforts'."""
        columns = self.payload.link_columns()
        assert columns is not None  # it hangs on a link
        error = self.model.error
        return np.hstack([columns, error.links, np.zeros((columns.shape[0], error.gains.shape[1] - error.c))])


def white_noise_variance(measurements: list[Measurement]) -> FloatArray:
    """Variance of the white part of the torques, shape (n,) [(N m)^2]: from their second differences, in which motion hardly
    shows.

    The median makes it robust against single faults; 0.455 is the median of chi-squared with one degree of freedom.
    """
    return white_variance(np.array([m.tau for m in measurements]))


def white_variance(channels: FloatArray) -> FloatArray:
    """Variance of the white part of each of c channels at N even samples, (N, c) -> (c,)."""
    second = np.diff(channels, 2, axis=0)
    variance: FloatArray = np.median(second * second, axis=0) / 0.455 / 6.0
    return variance
