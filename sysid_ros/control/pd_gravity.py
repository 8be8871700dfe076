"""PD with gravity compensation: what most robots do, to compare with."""

from __future__ import annotations

import numpy as np

from sysid_ros.control.arm_torque import ArmTorque
from sysid_ros.control.controller import TrackingController
from sysid_ros.control.feedback import Feedback
from sysid_ros.control.reference import Reference
from sysid_ros.control.settings import ControlSettings
from sysid_ros.sample import FloatArray


class PdGravity(TrackingController):
    """``tau = D (w^2 e + 2 w e') + g(q)``, e = q_d - q (Siciliano et al. 2009, section 8.5.1).

    D is the diagonal of the other laws' M_e, at the posture where the first state finds the arm: their gains there, constant and
    without the coupling of the joints. No payload is known.

    Args:
        arm: the model of the empty arm. settings: bandwidth and usual payload.
    """

    def __init__(self, arm: ArmTorque, settings: ControlSettings) -> None:
        self._arm = arm
        self.feedback = Feedback(arm, settings)
        self._diagonal: FloatArray | None = None

    @property
    def payload(self) -> FloatArray:
        return np.zeros(10)

    def torque(self, q: FloatArray, v: FloatArray, reference: Reference, period: float) -> FloatArray:
        if self._diagonal is None:
            self._diagonal = np.diag(self.feedback.matrix(q)).copy()
        w = self.feedback.bandwidth
        feedback = w**2 * (reference.q - q) + 2.0 * w * (reference.v - v)
        return np.asarray(self._diagonal * feedback + self._arm.robot.gravity_torque(q))
