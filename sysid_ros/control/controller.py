"""TrackingController: what turns a wanted motion and the measured state into torques; what it may believe of an estimate."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from sysid_ros.control.feedback import Feedback
from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.sample import FloatArray

_BELIEVED = ("ok", "no_payload", "not_excited")


@dataclass(frozen=True, slots=True)
class Reference:
    """The wanted motion at one instant, in the model's joint order.

    Attributes:
        q: positions, shape (n,) [rad or m]. v: velocities, shape (n,) [rad/s or m/s].
        a: accelerations, shape (n,) [rad/s^2 or m/s^2].
    """

    q: FloatArray
    v: FloatArray
    a: FloatArray

    def advance(self, later: Reference, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where an arm measured at q and v, shape (n,) each, will be when ``later`` is wanted, if its error stays the same.

        A torque acts some time after the state that it answers. Model and motion are taken at that time, the error is that of
        now: so the delay costs no accuracy along a wanted motion, and the feedback is what it was.
        """
        return q + later.q - self.q, v + later.v - self.v


class TrackingController(ABC):
    """A control law ``tau = k(q, v, reference)``, with or without a memory of what the arm carries.

    Attributes:
        feedback: bandwidth and weights of the feedback.
    """

    feedback: Feedback

    @abstractmethod
    def torque(self, q: FloatArray, v: FloatArray, reference: Reference, period: float) -> FloatArray:
        """Joint torques for now, shape (n,) [N m].

        Args:
            q, v: measured state, shape (n,) each. reference: what is wanted now. period: time since the last call [s].
        """

    @property
    @abstractmethod
    def payload(self) -> FloatArray:
        """The payload that the law believes in now, ten parameters in its frame, shape (10,)."""

    def recall(self, payload: FloatArray) -> None:  # noqa: B027 - what learns nothing has nothing to take back
        """Go back to a payload that was believed in before, shape (10,): what was learned since may be somebody's force."""

    def tell(self, payload: FloatArray | None) -> None:  # noqa: B027 - to hear nothing is right for most laws
        """Hear of the payload that may be believed, shape (10,), or that none may be (None). Most laws do not listen."""


def believed_payload(estimate: PayloadEstimate, mass_std: float) -> FloatArray | None:
    """Ten parameters, shape (10,), where the estimator stands by them; else None.

    Args:
        estimate: believed in the status ok, no_payload (then there is none: zeros) and not_excited.
        mass_std: largest standard deviation of a mass that is believed [kg].
    """
    # not >, so that NaN is not believed
    if estimate.status not in _BELIEVED or not estimate.mass_std <= mass_std or not np.isfinite(estimate.theta).all():
        return None
    return np.zeros(10) if estimate.status == "no_payload" else np.array(estimate.theta)
