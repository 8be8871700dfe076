"""How stiffly a controller tracks and how fast it learns, and when it stops."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.robot import inertial_parameters
from sysid_ros.sample import FloatArray


def _number(default: float, description: str, unit: str, low: float, high: float) -> Any:
    return field(default=default, metadata={"description": description, "unit": unit, "low": low, "high": high, "choices": ()})


def _check(settings: Any) -> None:
    for f in fields(settings):
        value, low, high = getattr(settings, f.name), f.metadata["low"], f.metadata["high"]
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise SettingsError(f"{f.name} is {value!r}; it must be a number from {low:g} to {high:g} {f.metadata['unit']}.")
        object.__setattr__(settings, f.name, float(value))


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlSettings:
    """Settings that all control laws share.

    ``bandwidth`` is the w of the closed loop: with the usual payload an error falls as ``(1 + w t) exp(-w t)``. The usual payload
    is a uniform ball about the frame's origin. The feedback is weighted by the inertia with it, as far as the loop's delay allows
    (:class:`sysid_ros.control.feedback.Feedback`), so that a wrist that weighs next to nothing stays firm when it carries
    something; and it is the unit in which the adaptive laws measure payloads.

    Raises:
        SettingsError: a value is not a number or out of its range.
    """

    bandwidth: float = _number(20.0, "of the closed loop", "rad/s", 0.1, 500.0)
    expected_mass: float = _number(2.0, "of a usual payload, by whose inertia the feedback is weighted", "kg", 0.001, 1000.0)
    expected_radius: float = _number(0.1, "of a ball with that mass about the frame's origin", "m", 0.001, 5.0)
    blend: float = _number(0.3, "time over which computed torque takes over a new payload", "s", 0.0, 60.0)
    adaptation_time: float = _number(0.05, "of the adaptive laws, at the posture where they are fastest", "s", 0.001, 60.0)
    composite_time: float = _number(0.5, "in which the composite law is drawn towards the estimator", "s", 0.001, 60.0)
    loop_delay: float = _number(
        0.004, "from a joint state to the effort that answers it, the period of the joint states included", "s", 0.0001, 1.0
    )
    largest_mass: float = _number(20.0, "the adaptive laws believe in no more", "kg", 0.01, 10000.0)
    dead_zone: float = _number(0.002, "a tracking error s below this teaches the adaptive laws nothing", "rad/s", 0.0, 10.0)

    def __post_init__(self) -> None:
        _check(self)

    @property
    def expected_payload(self) -> FloatArray:
        """The usual payload, ten parameters, shape (10,)."""
        inertia = 0.4 * self.expected_mass * self.expected_radius**2
        return inertial_parameters.from_com(self.expected_mass, np.zeros(3), inertia * np.eye(3))


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetySettings:
    """When a motion is refused or given up, and what torque may be used.

    Raises:
        SettingsError: a value is not a number or out of its range.
    """

    effort_limit_scale: float = _number(1.0, "part of the URDF's effort limits that may be used", "", 0.0, 1.0)
    error_limit: float = _number(0.3, "a joint this far from its motion ends the motion", "rad or m", 1e-4, 10.0)
    start_tolerance: float = _number(0.05, "a motion may begin this far from where the arm is wanted", "rad or m", 1e-4, 10.0)
    braking_time: float = _number(0.3, "in which the arm comes to rest where a motion ends early", "s", 0.01, 10.0)
    state_timeout: float = _number(0.1, "without joint states for so long the control loop is open", "s", 0.005, 10.0)

    def __post_init__(self) -> None:
        _check(self)
