"""Judgement: may the estimate of the payload be believed, and if not, why not."""

from __future__ import annotations

from sysid_ros.estimators import Estimate, Estimator, VariableForgetting
from sysid_ros.online.front_end import Rows
from sysid_ros.online.model_check import ModelCheck
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

_STAYS_KNOWN = 1.5
"""A mass that was known stays known up to so many times the limit, or the status would flicker at it."""


class Judgement:
    """Turns what estimator and model check know into one of the statuses of :mod:`sysid_ros.online.payload_estimate`.

    Args:
        robot: for the names of its joints. settings: the limits. floor: least variance of a row, shape (n,), of those
            rows that are torques.
    """

    def __init__(self, robot: RobotModel, settings: OnlineSettings, floor: FloatArray) -> None:
        self._settings = settings
        self._floor = floor
        self._check = ModelCheck(robot, rows=floor.size)
        self._known = False

    def add(self, rows: Rows, payload_torque: FloatArray, estimator: Estimator) -> None:
        """Take in rows of a moving robot and the payload's part in them, shape (n,) [N m]."""
        if _noise_known(estimator):
            n = self._floor.size
            self._check.add(rows.tau[:n], (rows.y - payload_torque)[:n])

    def status(self, estimate: Estimate, estimator: Estimator, mass: float, mass_std: float) -> tuple[str, str]:
        """Status and reason for a mass [kg] and its standard deviation [kg]."""
        s = self._settings
        if _noise_known(estimator) and isinstance(estimator, VariableForgetting):
            n = self._floor.size
            wrong = self._check.verdict(estimator.noise.variance[:n], estimator.row_variance[:n], self._floor)
            if wrong:
                return "inconsistent", wrong
        limit = max(s.mass_std_limit, 0.05 * abs(mass))
        self._known = mass_std <= (_STAYS_KNOWN if self._known else 1.0) * limit
        unknown = not self._known
        if estimate.status == "not_excited" and (unknown or not _noise_known(estimator)):
            known_to = f"the mass is known to {mass_std:.2g} kg only" if unknown else "the noise of the torques is not known yet"
            return "not_excited", f"The robot stands; {known_to}. Move the joints that carry the payload."
        if not _noise_known(estimator) or estimate.status == "warming_up":
            return "warming_up", f"{_sentence(estimate.reason) or 'The noise of the torques is not known yet.'} Keep moving."
        if isinstance(estimator, VariableForgetting) and not self._check.ready:
            return "warming_up", "Whether the robot's model explains the torques is not known yet. Keep moving."
        if unknown:
            return "warming_up", f"The mass is known to {mass_std:.2g} kg only. Keep moving."
        level = max(s.no_payload_mass, 1.96 * mass_std)
        if abs(mass) < level:
            return "no_payload", f"No payload above {level:.2g} kg."
        return "ok", "The robot stands; the estimate is held." if estimate.status == "not_excited" else _sentence(estimate.reason)


def _noise_known(estimator: Estimator) -> bool:
    return not isinstance(estimator, VariableForgetting) or estimator.noise.known


def _sentence(reason: str) -> str:
    return f"{reason[0].upper()}{reason[1:]}." if reason else ""
