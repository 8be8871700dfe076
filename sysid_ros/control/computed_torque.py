"""Computed torque: inverse dynamics of a model, and feedback weighted by the inertia."""

from __future__ import annotations

import numpy as np

from sysid_ros.control.arm_torque import ArmTorque
from sysid_ros.control.control_settings import ControlSettings
from sysid_ros.control.controller import Reference, TrackingController
from sysid_ros.control.feedback import Feedback
from sysid_ros.sample import FloatArray


class ComputedTorque(TrackingController):
    """``tau = M(q) a_d + C(q, v) v + g(q) + f(q, v_d) + M_e(q) (w^2 e + 2 w e')``, e = q_d - q.

    M, C, g are those of the arm with the payload that it believes in; M_e is that of :class:`Feedback`. Where the arm
    carries that and knows it, ``e'' + 2 w e' + w^2 e = 0`` (Siciliano et al. 2009, section 8.5.2). The feedback does not depend
    on what is believed: a loop whose gains grow with the estimate may swing up at the moment the payload drops.

    With ``listens`` it takes an estimator's payload for the truth: certainty equivalence (Goodwin, Sin 1984, section 6.3).

    Args:
        arm: the model. settings: bandwidth, usual payload and blend. payload: that it believes in at first, shape (10,).
    """

    def __init__(
        self, arm: ArmTorque, settings: ControlSettings, payload: FloatArray | None = None, listens: bool = False
    ) -> None:
        self._arm, self._settings, self._listens = arm, settings, listens
        self.feedback = Feedback(arm, settings)
        self._payload = np.zeros(10) if payload is None else np.array(payload, dtype=float)
        self._begin = self._target = self._payload
        self._blended = 1.0

    @property
    def payload(self) -> FloatArray:
        return self._payload

    def tell(self, payload: FloatArray | None) -> None:
        if self._listens and payload is not None:
            self.carry(payload)

    def carry(self, payload: FloatArray) -> None:
        """Believe in another payload, shape (10,), from now on; the change is spread over ``settings.blend``."""
        self._begin, self._target, self._blended = self._payload, np.array(payload, dtype=float), 0.0

    def torque(self, q: FloatArray, v: FloatArray, reference: Reference, period: float) -> FloatArray:
        self._advance(period)
        w = self.feedback.bandwidth
        feedback = w**2 * (reference.q - q) + 2.0 * w * (reference.v - v)
        columns, rest = self._arm.split(q, v, v, reference.a, reference.v)
        weighted = self.feedback.weighted(q, feedback)
        return np.asarray(rest + columns @ self._payload + weighted)

    def _advance(self, period: float) -> None:
        if self._blended >= 1.0:
            return
        # bodies between two that can exist can exist
        step = period / self._settings.blend if self._settings.blend > 0.0 else 1.0
        self._blended = min(1.0, self._blended + step)
        self._payload = self._begin + self._blended * (self._target - self._begin)
