"""PayloadEstimate and PayloadEvent: what the online estimation says of the payload; Judgement: whether that may be believed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from sysid_ros.estimators import Estimate, Estimator
from sysid_ros.online.evidence_words import further_off
from sysid_ros.online.model_check import IDENTIFY, ModelCheck
from sysid_ros.online.model_evidence import ModelEvidence
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.inertial_parameters import body_of, project_into
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

STATUSES = ("ok", "warming_up", "not_excited", "not_physical", "stale", "no_payload", "inconsistent")
_FORCE = "external_force"
_DISTURBED = "For two steps the torques have fitted neither what was known nor another payload: something pulls at the robot."
_STAYS_KNOWN = 1.5
"""A mass that was known stays known up to so many times the limit, or the status would flicker at it."""
ALL_OF_IT = 0.0, math.inf
"""Parts of a standard deviation where nothing of it lasts, and where it is not known what it would be."""
NOT_A_BODY = 29.6
"""99.9 % quantile of chi-squared with 10 degrees of freedom."""


@dataclass(frozen=True, slots=True)
class PayloadEvent:
    """A change of the payload, found from the innovations.

    Attributes:
        t: when it happened, corrected for the delay of the filters [s].
        kind: 'pick', 'drop', 'change', or 'external_force' where no body explains it.
        mass_before, mass_after: [kg].
    """

    t: float
    kind: str
    mass_before: float
    mass_after: float

    @property
    def passes(self) -> bool:
        """True of a force: what is carried stays."""
        return self.kind == _FORCE


class Body(NamedTuple):
    """What is carried, in the words of a mechanic.

    Attributes:
        mass: [kg]. com: in the frame, shape (3,) [m]; NaN where the mass is zero.
        inertia_com: about the centre of mass, axes parallel to the frame, shape (3, 3) [kg m^2].
        com_covariance: by the delta method, shape (3, 3) [m^2]; infinite variance where the mass is zero.
    """

    mass: float
    com: FloatArray
    inertia_com: FloatArray
    com_covariance: FloatArray


@dataclass(frozen=True)
class PayloadEstimate:
    """The payload and how well it is known.

    Attributes:
        t: stamp of the last sample used [s].
        frame: frame of com and inertia.
        theta: ten parameters about the frame's origin, pinocchio's order, shape (10,): the physical body nearest to the estimate.
        covariance: of theta, shape (10, 10).
        status: one of :data:`STATUSES`. reason: the same in a sentence.
        observable: shape (10,), bool: determined by this motion and not by the prior.
        residual: measured minus predicted torque after the low-pass, shape (n,) [N m].
        payload_effort: joint torques that the payload costs now, shape (n,) [N m].
    """

    t: float
    frame: str
    theta: FloatArray
    covariance: FloatArray
    status: str
    reason: str
    observable: np.ndarray[tuple[int], np.dtype[np.bool_]]
    residual: FloatArray
    payload_effort: FloatArray

    @classmethod
    def unknown(cls, frame: str, prior_std: FloatArray, n: int) -> PayloadEstimate:
        """Nothing but a prior of the standard deviation (10,), on a robot of n joints."""
        return cls(
            t=0.0,
            frame=frame,
            theta=np.zeros(10),
            covariance=np.diag(prior_std**2),
            status="warming_up",
            reason="There is no estimate yet.",
            observable=np.zeros(10, dtype=bool),
            residual=np.zeros(n),
            payload_effort=np.zeros(n),
        )

    @cached_property
    def body(self) -> Body:
        """The parameters as a body, computed once."""
        return Body(*body_of(self.theta, self.covariance))

    @cached_property
    def is_empty(self) -> bool:
        """True where the estimate says that nothing is carried: no payload, or a mass that no body has."""
        return self.status == "no_payload" or not self.theta[0] > 0.0

    @property
    def mass(self) -> float:
        """[kg]"""
        return float(self.theta[0])

    @property
    def com(self) -> FloatArray:
        """As of :class:`Body`."""
        return self.body.com

    @property
    def inertia_com(self) -> FloatArray:
        """As of :class:`Body`."""
        return self.body.inertia_com

    @property
    def std(self) -> FloatArray:
        """Standard deviation of theta, shape (10,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def mass_std(self) -> float:
        """[kg]"""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def com_std(self) -> FloatArray:
        """Standard deviation of the centre of mass, shape (3,) [m]."""
        return np.sqrt(np.diag(self.body.com_covariance))


def nearest_body(theta: FloatArray, noise: FloatArray, covariance: FloatArray) -> tuple[FloatArray, float]:
    """The body nearest to parameters (10,), and its squared distance by their covariance (10, 10), a part of which is of noise.

    What the noise alone explains is not laid on the errors of the model, which would draw the mass along; nor is what not even
    these explain.
    """
    nearest = theta.copy()
    distance = float(project_into(theta, covariance, nearest))
    if distance > 0.0:
        within = nearest.copy()
        if project_into(theta, noise, within) <= NOT_A_BODY or distance > NOT_A_BODY:
            nearest = within
    return nearest, distance


class Judgement:
    """Turns what estimator and model check know into one of the statuses in :data:`STATUSES`.

    Args:
        robot: for the names of its joints. settings: the limits. floor: least variance of a row, shape (n,), of those
            rows that are torques. least: what the mass need not be known better to [kg]. evidence: of an arm whose efforts hold
            what it weighs, by how much its model is wrong.

    Attributes:
        check: of the model of another robot. evidence: as given.
    """

    def __init__(
        self,
        robot: RobotModel,
        settings: OnlineSettings,
        floor: FloatArray,
        least: float = 0.0,
        evidence: ModelEvidence | None = None,
    ) -> None:
        self._settings = settings
        self._limit = max(settings.mass_std_limit, least)
        self._floor = floor
        self.check, self.evidence = ModelCheck(robot, rows=floor.size), evidence
        self._known = False

    def with_errors(self, noise: FloatArray, sensitivity: FloatArray, gained: int) -> tuple[FloatArray, tuple[float, float]]:
        """Covariance of parameters, shape (k, k): of noise and of errors of what is known, which are as far off as the rows
        tell. Of the first, the mass [kg], the standard deviation that no motion lessens, and is not waited for, and the whole if
        the model were as it is said to be.

        Args:
            noise: covariance without these errors, shape (k, k). sensitivity: derivative by them, shape (k, c), of which the
                last ``gained`` are of the efforts' gains.
        """
        links, gains = (1.0, 1.0) if self.evidence is None else (self.evidence.links, self.evidence.gains)
        covariance = np.empty(noise.shape)
        return covariance, _with_errors(noise, sensitivity, sensitivity.shape[1] - gained, links, gains, covariance)

    def status(
        self, estimate: Estimate, estimator: Estimator, mass: float, mass_std: float, parts: tuple[float, float] = ALL_OF_IT
    ) -> tuple[str, str]:
        """Status and reason for a mass [kg] and its standard deviation [kg], with the ``parts`` of :meth:`with_errors`."""
        s, n, noise_known = self._settings, self._floor.size, estimator.noise_known
        if noise_known:
            wrong = (
                self.check.verdict(estimator.noise_variance[:n], estimator.row_variance[:n], self._floor)
                if self.evidence is None
                else self.evidence.not_shown
            )
            if wrong:
                return "inconsistent", wrong
        limit, (lasting, as_said) = max(self._limit, 0.05 * abs(mass)), parts
        if self.evidence is not None and parts != ALL_OF_IT:  # after a tare it does not know that nothing was carried
            mean, std = self.evidence.mass
            square = std**2 if math.isnan(mean) else std**2 + (mass - mean) ** 2
            if square - lasting**2 > mass_std**2:  # what gains make is in both masses
                mass_std, lasting = math.sqrt(square), math.sqrt(2.0) * lasting
        left = math.sqrt(max(mass_std**2 - lasting**2, 0.0))
        limit *= _STAYS_KNOWN if self._known else 1.0
        self._known = left <= limit
        unknown = not self._known
        if self.evidence is not None and self.evidence.times > 1.0 and math.sqrt(max(mass_std**2 - as_said**2, 0.0)) > limit:
            wrong = further_off(self.evidence.links, self.evidence.gains, self.evidence.times)
            return "inconsistent", f"{wrong} With that the mass is known to {mass_std:.2g} kg only. {IDENTIFY}"
        if estimate.status == "not_excited" and (unknown or not noise_known):
            known_to = f"the mass is known to {mass_std:.2g} kg only" if unknown else "the noise of the torques is not known yet"
            return "not_excited", f"The robot stands; {known_to}. Move the joints that carry the payload."
        if estimator.disturbed:
            return "inconsistent", _DISTURBED
        reason = f"{estimate.reason[0].upper()}{estimate.reason[1:]}." if estimate.reason else ""
        if not noise_known or estimate.status == "warming_up":
            return "warming_up", f"{reason or 'The noise of the torques is not known yet.'} Keep moving."
        if not (self.check if self.evidence is None else self.evidence).ready:
            return "warming_up", "Whether the robot's model explains the torques is not known yet. Keep moving."
        if unknown:
            return "warming_up", f"The mass is known to {mass_std:.2g} kg only. Keep moving."
        level = max(s.no_payload_mass, 1.96 * mass_std)
        if abs(mass) < level:
            return "no_payload", f"No payload above {level:.2g} kg."
        return "ok", "The robot stands; the estimate is held." if estimate.status == "not_excited" else reason


@njit(cache=True, error_model="numpy", nogil=True)  # type: ignore[untyped-decorator]
def _with_errors(
    noise: FloatArray, sensitivity: FloatArray, by_gains: int, links: float, gains: float, out: FloatArray
) -> tuple[float, float]:
    """As :meth:`Judgement.with_errors`, the covariance into ``out``: errors up to the column ``by_gains`` are ``links`` times as
    large as is said, those from there on ``gains`` times."""
    count, c = sensitivity.shape
    larger, squares = np.empty((count, c)), np.zeros((count, count))
    of_mass = of_gains = 0.0
    for k in range(c):
        times = links if k < by_gains else gains
        for a in range(count):
            larger[a, k] = sensitivity[a, k] * times
        of_mass += sensitivity[0, k] ** 2
        of_gains += larger[0, k] ** 2 if k >= by_gains else 0.0
    if c > 0:
        np.dot(larger, larger.T, squares)
    for a in range(count):
        for b in range(a + 1):
            out[a, b] = noise[a, b] + squares[a, b]
            out[b, a] = noise[b, a] + squares[a, b]
    return np.sqrt(of_gains), np.sqrt(noise[0, 0] + of_mass)
