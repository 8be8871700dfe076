"""Certainty equivalence: computed torque with the payload that an estimator has found."""

from __future__ import annotations

from sysid_ros.control.computed_torque import ComputedTorque
from sysid_ros.control.controller import TrackingController
from sysid_ros.control.reference import Reference
from sysid_ros.sample import FloatArray


class CertaintyEquivalence(TrackingController):
    """Computed torque that takes the estimate for the truth (Goodwin, Sin 1984, section 6.3).

    Args:
        law: the computed torque that is informed.
    """

    def __init__(self, law: ComputedTorque) -> None:
        self._law = law
        self.feedback = law.feedback

    @property
    def payload(self) -> FloatArray:
        return self._law.payload

    def tell(self, payload: FloatArray | None) -> None:
        if payload is not None:
            self._law.carry(payload)

    def torque(self, q: FloatArray, v: FloatArray, reference: Reference, period: float) -> FloatArray:
        return self._law.torque(q, v, reference, period)
