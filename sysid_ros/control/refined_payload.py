"""RefinedPayload: a payload that was told, refined by what a controller's own torques say, as far as both are of one thing."""

from __future__ import annotations

from typing import Final

import numpy as np

from sysid_ros.control.own_torque import OwnTorque
from sysid_ros.online_settings import OnlineSettings
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray

_CHANGED: Final = 0.1
"""Probability, before any data, that what was told and what is carried are not of the same thing: something is picked up or put
down every ten seconds, and a second passes until that is told."""
_IMPOSSIBLE: Final = 1e-9
"""Probability below which what was told is all that is left."""


class RefinedPayload:
    """What was told with its covariance, and what the torques that were sent say beside it: :func:`refined`.

    Args:
        own: takes in what is sent.

    Attributes:
        covariance: of what was told last, shape (10, 10); None where it was not told, and so is believed as it is.
    """

    def __init__(self, own: OwnTorque) -> None:
        self.own = own
        self.covariance: FloatArray | None = None

    def of(self, told: FloatArray) -> FloatArray | None:
        """What is carried where ``told`` is believed, shape (10,); None where there is nothing to refine it by, or nothing is
        carried."""
        found = self.own.payload
        if found is None or self.covariance is None or not told[0] > 0.0:
            return None
        try:
            mean = refined(told, self.covariance, *found)
        except np.linalg.LinAlgError:  # a covariance that was told may be of any rank
            return None
        return mean if np.isfinite(mean).all() else None


def refined(told: FloatArray, told_covariance: FloatArray, own: FloatArray, own_covariance: FloatArray) -> FloatArray:
    """The mean of what is carried, shape (10,), over the two answers to whether ``own`` is of what was told:

        same:     own - told ~ N(0, P_told + P_own),          carried is told + P_told (P_told + P_own)^-1 (own - told);
        changed:  own - told ~ N(0, P_told + P_own + P_0),    and until that is told, what was told is believed,

    P_0 the estimator's prior of a payload. The odds are the Bayes factor times those before any data. The first is the posterior
    of two independent measurements, brought to the nearest body; a mean of bodies is a body.

    Args:
        told, own: shape (10,). told_covariance, own_covariance: shape (10, 10).
    """
    unit = OnlineSettings().payload_prior
    P, away = told_covariance / np.outer(unit, unit), (own - told) / unit
    same = P + own_covariance / np.outer(unit, unit)
    changed = same + np.eye(10)
    towards = np.linalg.solve(same, away)
    square = float(away @ towards - away @ np.linalg.solve(changed, away))
    factor = 0.5 * (float(np.linalg.slogdet(changed)[1] - np.linalg.slogdet(same)[1]) - square)
    odds = factor + np.log((1.0 - _CHANGED) / _CHANGED)
    probability = 0.5 * (1.0 + np.tanh(0.5 * odds))
    if probability < _IMPOSSIBLE:
        return told
    mean = told + unit * (P @ towards)
    left = (P - P @ np.linalg.solve(same, P)) * np.outer(unit, unit)
    body, _ = inertial_parameters.project(mean, 0.5 * (left + left.T))
    return np.asarray(told + probability * (body - told))
