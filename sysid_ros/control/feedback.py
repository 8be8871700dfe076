"""Feedback: how firm a loop may be that answers late."""

from __future__ import annotations

import numpy as np

from sysid_ros.control.arm_torque import ArmTorque
from sysid_ros.control.control_settings import ControlSettings
from sysid_ros.sample import FloatArray

_POSTURES = 50
_FIRMEST = 0.5
"""Largest rate of damping times delay. A damped mass whose damper answers late swings up from pi / 2 on."""


class Feedback:
    """The inertia M_e = M + alpha M_p that all laws weight their feedback by, and their bandwidth w.

    M_p is what the usual payload adds. A law damps by ``w ((2 - k) M + k M_e)``: k is 2 for computed torque, 1 for laws whose
    wanted acceleration holds the error's velocity. An arm without payload that obeys this a delay T late is damped at rates up to
    ``w (2 + k alpha lambda)``, lambda the largest eigenvalue of M^-1 M_p over all postures; alpha is the largest up to 1 for
    which that is at most 0.5 / T, and w is lowered only where alpha = 0 is not enough.

    Args:
        arm: the model. settings: bandwidth, usual payload and delay of the loop. weighted: k.

    Attributes:
        bandwidth: w [rad/s]. share: alpha. delay: T [s].
        lead: T / 2, when a torque is taken to act [s]: the true delay lies somewhere between none and T.
        notes: what was lowered, a sentence each.
    """

    def __init__(self, arm: ArmTorque, settings: ControlSettings, weighted: float = 2.0) -> None:
        self._arm, self.delay, self.lead = arm, settings.loop_delay, settings.loop_delay / 2.0
        fastest = _FIRMEST / settings.loop_delay
        self.bandwidth = min(settings.bandwidth, fastest / 2.0)
        heaviest = _largest_added(arm, settings.expected_payload)
        self.share = float(np.clip((fastest / self.bandwidth - 2.0) / max(weighted * heaviest, 1e-12), 0.0, 1.0))
        self._firmest = 1.0 + self.share * heaviest
        self._added: FloatArray = self.share * settings.expected_payload
        self.notes: tuple[str, ...] = ()
        if self.bandwidth < settings.bandwidth:
            self.notes = (
                f"With a loop_delay of {1e3 * settings.loop_delay:g} ms the bandwidth is {self.bandwidth:.1f} rad/s and not "
                f"{settings.bandwidth:g}. Shorten the delay: a higher rate of the joint states, a free processor.",
            )
        elif self.share < 0.5:
            self.notes = (
                f"With a loop_delay of {1e3 * settings.loop_delay:g} ms the feedback counts on {100 * self.share:.0f} % of the "
                "usual payload's inertia, or the lightest joint would tremble. Shorten the delay for firmer joints, or give the "
                "rotors' inertia in model.yaml.",
            )

    def calm(self, delay: float) -> float:
        """Largest w [rad/s] for which ``M a = -2 w M_e v`` is as calm with that delay [s] as a law is with its own."""
        return _FIRMEST / (2.0 * self._firmest * delay)

    def weighted(self, q: FloatArray, x: FloatArray) -> FloatArray:
        """``M_e(q) x``, shape (n,)."""
        return self._arm.inertial_torque(q, x, self._added)

    def matrix(self, q: FloatArray) -> FloatArray:
        """M_e(q), shape (n, n)."""
        return inertia(self._arm, q, self._added)


def postures(arm: ArmTorque) -> FloatArray:
    """Random postures within the arm's ranges, shape (m, n)."""
    robot = arm.robot
    low, high = np.maximum(robot.position_lower, -np.pi), np.minimum(robot.position_upper, np.pi)
    return np.random.default_rng(0).uniform(low, high, (_POSTURES, robot.n))


def _largest_added(arm: ArmTorque, payload: FloatArray) -> float:
    """Largest eigenvalue of M^-1 M_p over the postures."""
    largest = 0.0
    for q in postures(arm):
        bare = inertia(arm, q, np.zeros(10))
        added = np.linalg.solve(bare, inertia(arm, q, payload) - bare)
        largest = max(largest, float(np.abs(np.linalg.eigvals(added)).max()))
    return largest


def inertia(arm: ArmTorque, q: FloatArray, payload: FloatArray) -> FloatArray:
    """M(q) with a payload, shape (n, n)."""
    return np.column_stack([arm.inertial_torque(q, unit, payload) for unit in np.eye(len(q))])
