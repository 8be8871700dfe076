"""The adaptive law of Slotine and Li: the payload is learned from the tracking error, and only as far as tracking needs it."""

from __future__ import annotations

import numpy as np

from sysid_ros.control.arm_torque import ArmTorque
from sysid_ros.control.control_settings import ControlSettings
from sysid_ros.control.controller import Reference, TrackingController
from sysid_ros.control.feedback import Feedback, postures
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.inertial_parameters import project
from sysid_ros.sample import FloatArray

_SLOWEST = 10.0
"""Least adaptation time in delays of the loop."""


class SlotineLi(TrackingController):
    """``tau = M(q) a_r + C(q, v) v_r + g(q) + f(q, v_d) - w M_e(q) s``, and ``d theta / dt = -Gamma Y_p' s``.

    M, C, g are those of the arm with the payload theta, M_e is that of :class:`Feedback`. With e = q - q_d:
    ``v_r = v_d - w e``, ``a_r = a_d - w e'``, ``s = v - v_r = e' + w e`` (Slotine, Li 1987). Along the motions of a right model
    with the payload theta*, ``V = s' M s / 2 + (theta - theta*)' Gamma^-1 (theta - theta*) / 2`` never grows, so s goes to zero
    whatever the payload is; theta goes to theta* where the motion excites it.

    Gamma is constant, proportional to the inverse of the metric of bodies (Lee, Kwon, Park 2018) at the usual payload, so that
    neither units nor axes matter. theta is kept a body that can exist: the projection in the metric Gamma^-1 onto this convex set
    can only bring it nearer to the truth. Components of s within the dead zone teach nothing (Peterson, Narendra 1982).

    With ``composite`` the payload is also drawn towards an estimator's, ``- (theta - theta_e) / T`` (composite adaptation;
    Slotine, Li 1989): at once by the tracking error, in the end as exact as the estimate.

    Args:
        arm: the model. settings: bandwidth, usual payload, times of adaptation, dead zone.
        composite: listen to the estimator.
    """

    def __init__(self, arm: ArmTorque, settings: ControlSettings, composite: bool = False) -> None:
        self._arm, self._settings, self._composite = arm, settings, composite
        self._heard: FloatArray | None = None
        self.feedback = Feedback(arm, settings, weighted=1.0)
        self._payload: FloatArray = np.zeros(10)
        self.gain = adaptation_gain(arm, settings, self.feedback)

    @property
    def payload(self) -> FloatArray:
        return self._payload

    def torque(self, q: FloatArray, v: FloatArray, reference: Reference, period: float) -> FloatArray:
        w = self.feedback.bandwidth
        away = q - reference.q
        v_r, a_r = reference.v - w * away, reference.a - w * (v - reference.v)
        s = v - v_r
        columns, rest = self._arm.split(q, v, v_r, a_r, reference.v)
        weighted = self.feedback.weighted(q, s)
        tau = rest + columns @ self._payload - w * weighted
        zone = self._settings.dead_zone
        learned = self._payload - period * self.gain @ (columns.T @ (s - np.clip(s, -zone, zone)))
        if self._heard is not None:
            learned += min(1.0, period / self._settings.composite_time) * (self._heard - self._payload)
        if np.any(learned != self._payload):
            self._payload, _ = project(learned, self.gain)
            if self._payload[0] > self._settings.largest_mass:
                self._payload *= self._settings.largest_mass / self._payload[0]
        return np.asarray(tau)

    def recall(self, payload: FloatArray) -> None:
        self._payload = np.array(payload)

    def tell(self, payload: FloatArray | None) -> None:
        if self._composite:
            self._heard = payload


def adaptation_gain(arm: ArmTorque, settings: ControlSettings, feedback: Feedback) -> FloatArray:
    """Gamma, shape (10, 10): the payload's error decays within the adaptation time where the arm's posture makes it fastest.

    With the damping K = w M_e, s follows ``K s = Y (theta* - theta)`` in the steady state, so theta decays at the rates of
    ``Gamma Y' K^-1 Y``. It is no faster than a loop of that delay can follow.
    """
    body = inertial_parameters.pseudo_inertia(settings.expected_payload)
    basis = np.linalg.solve(body, np.array([inertial_parameters.pseudo_inertia(e) for e in np.eye(10)]))
    shape = np.linalg.inv(np.einsum("aij,bji->ab", basis, basis))
    still, fastest = np.zeros(arm.robot.n), 0.0
    for q in postures(arm):
        columns, _ = arm.split(q, still, still, still, still)
        rates = np.linalg.eigvals(shape @ columns.T @ np.linalg.solve(feedback.bandwidth * feedback.matrix(q), columns))
        fastest = max(fastest, float(np.abs(rates).max()))
    return np.asarray(shape / (fastest * max(settings.adaptation_time, _SLOWEST * settings.loop_delay)))
