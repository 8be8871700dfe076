"""PayloadEstimate and PayloadEvent: what the online estimation says of the payload; Judgement: whether that may be believed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from sysid_ros.estimators import Estimate, Estimator
from sysid_ros.online.known_share import KnownShare, average_row
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.inertial_parameters import body_of, project_into
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

STATUSES = ("ok", "warming_up", "not_excited", "not_physical", "stale", "no_payload", "inconsistent")
_FORCE = "external_force"
_IDENTIFY = "Identify the arm without a payload ('sysid identify') and give the model with --model."
_LOOK = "Check the URDF's legs and feet, and that the IMU is low-passed before it is published and stamped like the joints."
_DISTURBED = "For two steps the torques have fitted neither what was known nor another payload: something pulls at the robot."
NOT_A_BODY = 29.6
"""99.9 % quantile of chi-squared with 10 degrees of freedom."""
_STAYS_KNOWN = 1.5
"""A mass that was known stays known up to so many times the limit, or the status would flicker at it."""


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
    distance, within = float(project_into(theta, covariance, nearest)), nearest.copy()
    if distance > 0.0 and (project_into(theta, noise, within) <= NOT_A_BODY or distance > NOT_A_BODY):
        nearest = within
    return nearest, distance


class ModelCheck:
    """Compares what known model and payload leave unexplained with the torque itself and with the noise it could be.

    A payload is only as good as the arm's model beneath it. Where the residual is both a large part of the torque and far above
    the noise that the torque signal itself shows at high frequency (or that the model states), it is not noise: the model is
    wrong.

    Args:
        robot: for the names of the joints.
        memory: time constant of the averages [updates]. rows: how many of its joints have rows, from the first on; None: all.

    Attributes:
        memory: as given. ready: True once there are enough updates for a verdict.
        part: as of the last verdict, rms of what is unexplained over rms of the torque, a joint, shape (n,); 0 where the joint
            carries next to nothing. share: of what the arm weighs, where the efforts hold it; not_shown: its verdict.
    """

    PART = 0.25
    TIMES_NOISE = 10.0
    JOINTS = 0.6
    REMAINS = 0.03
    FEWEST, ASK = 300, 50

    def __init__(self, robot: RobotModel, memory: float = 3000.0, rows: int | None = None) -> None:
        n = robot.n if rows is None else rows
        self._cure = _IDENTIFY if rows in (None, robot.n) else _LOOK
        self._names = robot.joint_names[:n]
        self._weak = 0.005 * np.where(np.isfinite(robot.effort_limit), robot.effort_limit, 50.0)[:n]
        self.memory = memory
        self._torque = np.zeros(n)
        self._unexplained = np.zeros(n)
        self._count = 0
        self.ready = False
        self.part: FloatArray = np.zeros(n)
        self.share: KnownShare | None = None
        self.not_shown, self._nothing = "", np.zeros((5, 0))

    def add(self, torque: FloatArray, Y: FloatArray, y: FloatArray, theta: FloatArray) -> None:
        """Take in measured torque, shape (n,), and the first columns of the equation ``y = Y theta`` with their parameters, those
        of the payload, after the low-pass [N m]."""
        self._count += 1
        self.ready = self._count >= self.FEWEST
        rate = max(1.0 / self._count, 1.0 / self.memory)
        moments = self.share.moments if self.share is not None else self._nothing
        average_row(torque, Y, y, theta, rate, self._torque, self._unexplained, moments)
        if self.share is not None and self._count % self.ASK == 0:
            self.not_shown = self.share.verdict(self._count)

    def verdict(self, noise: FloatArray, residual: FloatArray, floor: FloatArray) -> str:
        """A sentence that names the worst joints where the model is wrong, else an empty string.

        Args:
            noise: long-run variance of the residual, a joint, shape (n,). residual: its variance, shape (n,) [(N m)^2].
            floor: what is known to be noise, as a long-run variance, shape (n,).
        """
        if not self.ready:
            return ""
        self.part = part = np.sqrt(self._unexplained / np.maximum(self._torque, self._weak**2))
        if float(part.sum()) < self.PART * part.size:
            return ""
        usual = float(np.quantile(np.sqrt(noise / floor), self.JOINTS))
        # noise that is slow is far above its white part too, but it is small beside the torque
        remains = float(np.sqrt(residual).sum() / np.sqrt(np.maximum(self._torque, self._weak**2)).sum())
        if usual < self.TIMES_NOISE or remains < self.REMAINS:
            return ""
        worst = np.argsort(-np.sqrt(self._unexplained))[:3]
        listed = ", ".join(
            f"{self._names[i]} {np.sqrt(self._unexplained[i]):.2g} N m ({100 * part[i]:.0f} % of its torque)" for i in worst
        )
        times = f"{usual:.0f}" if usual < 1000.0 else "over a thousand"
        return (
            f"The residual is far above any noise that it could be ({times} times): rms {listed}. "
            "The robot's model does not explain these torques; the payload can't be trusted. " + self._cure
        )


class Judgement:
    """Turns what estimator and model check know into one of the statuses in :data:`STATUSES`.

    Args:
        robot: for the names of its joints. settings: the limits. floor: least variance of a row, shape (n,), of those
            rows that are torques. least: what the mass need not be known better to [kg].

    Attributes:
        check: of the model.
    """

    def __init__(self, robot: RobotModel, settings: OnlineSettings, floor: FloatArray, least: float = 0.0) -> None:
        self._settings = settings
        self._limit = max(settings.mass_std_limit, least)
        self._floor = floor
        self.check = ModelCheck(robot, rows=floor.size)
        weighs = floor.size == robot.n and settings.effort_type == "total"
        self.check.share = KnownShare(robot.n, 1.0 / settings.update_rate, self.check.memory) if weighs else None
        self._known = False

    def status(
        self, estimate: Estimate, estimator: Estimator, mass: float, mass_std: float, lasting: float = 0.0
    ) -> tuple[str, str]:
        """Status and reason for a mass [kg] and its standard deviation [kg]; a ``lasting`` part of that, which no motion lessens,
        is not waited for."""
        s, n, noise_known = self._settings, self._floor.size, estimator.noise_known
        if noise_known:
            wrong = self.check.not_shown or self.check.verdict(
                estimator.noise_variance[:n], estimator.row_variance[:n], self._floor
            )
            if wrong:
                return "inconsistent", wrong
        limit = max(self._limit, 0.05 * abs(mass))
        left = float(np.sqrt(max(mass_std**2 - lasting**2, 0.0)))
        self._known = left <= (_STAYS_KNOWN if self._known else 1.0) * limit
        unknown = not self._known
        if estimate.status == "not_excited" and (unknown or not noise_known):
            known_to = f"the mass is known to {mass_std:.2g} kg only" if unknown else "the noise of the torques is not known yet"
            return "not_excited", f"The robot stands; {known_to}. Move the joints that carry the payload."
        if estimator.disturbed:
            return "inconsistent", _DISTURBED
        reason = f"{estimate.reason[0].upper()}{estimate.reason[1:]}." if estimate.reason else ""
        if not noise_known or estimate.status == "warming_up":
            return "warming_up", f"{reason or 'The noise of the torques is not known yet.'} Keep moving."
        if not self.check.ready:
            return "warming_up", "Whether the robot's model explains the torques is not known yet. Keep moving."
        if unknown:
            return "warming_up", f"The mass is known to {mass_std:.2g} kg only. Keep moving."
        level = max(s.no_payload_mass, 1.96 * mass_std)
        if abs(mass) < level:
            return "no_payload", f"No payload above {level:.2g} kg."
        return "ok", "The robot stands; the estimate is held." if estimate.status == "not_excited" else reason
