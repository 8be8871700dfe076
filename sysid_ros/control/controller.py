"""TrackingController: what turns a wanted motion and the measured state into joint torques."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sysid_ros.control.feedback import Feedback
from sysid_ros.control.reference import Reference
from sysid_ros.sample import FloatArray


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

    def tell(self, payload: FloatArray | None) -> None:  # noqa: B027 - to hear nothing is right for most laws
        """Hear of the payload that may be believed, shape (10,), or that none may be (None). Most laws do not listen."""
