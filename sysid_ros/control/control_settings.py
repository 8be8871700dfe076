"""How stiffly a controller tracks and how fast it learns, and when it stops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sysid_ros.online_settings import Settings, setting
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlSettings(Settings):
    """Settings that all control laws share.

    ``bandwidth`` is the w of the closed loop: with the usual payload an error falls as ``(1 + w t) exp(-w t)``. The usual payload
    is a uniform ball about the frame's origin. The feedback is weighted by the inertia with it, as far as the loop's delay allows
    (:class:`sysid_ros.control.feedback.Feedback`), so that a wrist that weighs next to nothing stays firm when it carries
    something; and it is the unit in which the adaptive laws measure payloads.
    """

    bandwidth: float = setting(20.0, "of the closed loop", "rad/s", 0.1, 500.0)
    expected_mass: float = setting(2.0, "of a usual payload, by whose inertia the feedback is weighted", "kg", 0.001, 1000.0)
    expected_radius: float = setting(0.1, "of a ball with that mass about the frame's origin", "m", 0.001, 5.0)
    blend: float = setting(0.3, "time over which computed torque takes over a new payload", "s", 0.0, 60.0)
    adaptation_time: float = setting(0.05, "of the adaptive laws, at the posture where they are fastest", "s", 0.001, 60.0)
    composite_time: float = setting(0.2, "in which the composite law is drawn towards the estimator", "s", 0.001, 60.0)
    loop_delay: float = setting(
        0.004, "from a joint state to the effort that answers it, the period of the joint states included", "s", 0.0001, 1.0
    )
    largest_mass: float = setting(20.0, "the adaptive laws believe in no more", "kg", 0.01, 10000.0)
    dead_zone: float = setting(0.002, "a tracking error s below this teaches the adaptive laws nothing", "rad/s", 0.0, 10.0)

    @property
    def expected_payload(self) -> FloatArray:
        """The usual payload, ten parameters, shape (10,)."""
        inertia = 0.4 * self.expected_mass * self.expected_radius**2
        return inertial_parameters.from_com(self.expected_mass, np.zeros(3), inertia * np.eye(3))


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetySettings(Settings):
    """When a motion is refused or given up, and what torque may be used."""

    effort_limit_scale: float = setting(1.0, "part of the URDF's effort limits that may be used", "", 0.0, 1.0)
    effort_rise_time: float = setting(
        0.05, "in which an effort may go from nothing to its limit, at the fastest", "s", 0.0005, 10.0
    )
    error_limit: float = setting(0.3, "a joint this far from its motion ends the motion", "rad or m", 1e-4, 10.0)
    start_tolerance: float = setting(0.05, "a motion may begin this far from where the arm is wanted", "rad or m", 1e-4, 10.0)
    braking_time: float = setting(0.3, "in which the arm comes to rest where a motion ends early", "s", 0.01, 10.0)
    state_timeout: float = setting(0.1, "without joint states for so long the control loop is open", "s", 0.005, 10.0)
