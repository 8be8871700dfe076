"""What physics allows of an effect's parameters: friction takes power, inertia is positive, a payload has a mass."""

from __future__ import annotations

import numpy as np

from sysid_ros.diagnosis.term import Term
from sysid_ros.sample import FloatArray

_POSITIVE = (
    "coulomb_friction",
    "viscous_friction",
    "quadratic_friction",
    "presliding_hysteresis",
    "rotor_inertia",
    "joint_elasticity",
    "backlash",
)
_UNIT_SHARE = (0.6, 1.5)
_COMPENSATED = 0.15
_BREAKAWAY = 4.0
"""Breakaway friction is not more than so many times the friction of steady sliding."""
_DRIFTS = 4.0
"""Standard deviations that a rate must be away from zero."""
_YIELDS = 0.2
"""No gear yields by more under the loads of a recording [rad]."""


def allowed(term: Term, theta: FloatArray, std: FloatArray) -> bool:
    """True where the parameters are possible within twice their standard deviation.

    Args:
        theta, std: of the term's columns, shape (p,).
    """
    high = theta + 2.0 * std
    value = float(theta[0])
    if term.id in _POSITIVE and value <= 0.0:
        return False
    if term.id == "asymmetric_coulomb_friction":
        return bool(np.all(high > 0.0)) and float(theta.sum()) > 0.0
    if term.id == "stribeck_friction":
        return bool(high[0] > 0.0 and max(theta[0], 0.0) < theta[1] < _BREAKAWAY * max(high[0], 0.2 * theta[1]))
    if term.id == "load_dependent_friction":
        return bool(high[0] > 0.0 and theta[1] > 0.0)
    if term.id == "friction_drift":
        drifts = np.abs(theta[[1, 3]]) > _DRIFTS * np.maximum(std[[1, 3]], 1e-12)
        return bool(high[0] > 0.0 and high[2] > 0.0 and np.any(drifts))
    if term.id in ("payload", "payload_change"):
        return value > 0.0 or term.id == "payload_change"
    if term.id == "torque_saturation":
        return _UNIT_SHARE[0] < value < _UNIT_SHARE[1] and float(term.effect.settings["limit"]) > 0.95 * term.load
    if term.id == "gravity_compensated_effort":
        return min(abs(value - 1.0), abs(value + 1.0)) < _COMPENSATED
    if term.id == "torque_scale":
        return value > -0.98
    if term.id == "base_tilt":
        return bool(np.all(np.abs(theta) < 0.6))
    if term.id == "joint_elasticity" and value * term.load > _YIELDS:
        return False
    if term.id == "joint_offset":
        return abs(value) < 0.7
    if term.id == "time_delay":
        return abs(value) < 0.2
    if term.id == "link_inertia" and term.form != "scale":
        robot = term.effect.robot
        if robot.body_names[term.joints[0]] == robot.default_frame and value > 0.0:
            return False  # that is what a payload is
        return bool(robot.pi[10 * term.joints[0]] + high[0] > 0.0)
    if term.id == "link_inertia":
        return value > -1.0
    return True
