"""ExcitationSettings: what an exciting motion is asked to be."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from sysid_ros.exceptions import SettingsError


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationSettings:
    """What is asked of the motion, and what is kept free of the robot's limits.

    Attributes:
        duration: of the motion [s]. period: it repeats itself after that long [s]; 0: about 10 s, a whole number of times.
        harmonics: of the Fourier series, 2 or more; the fastest is ``harmonics / period``.
        starts: local searches, each from another random motion. seed: of all that is random.
        comparison: random feasible motions that the result is compared with, and that the searches start from.
        position_scale, velocity_scale, effort_scale: part of a joint's range about its middle, and of its limits of velocity and
            effort, that may be used; over 0 to 1.
        velocity_default: where the URDF states no limit [rad/s or m/s].
        acceleration_limit: of revolute joints [rad/s^2]; slide_acceleration_limit: of prismatic joints [m/s^2].
        clearance: least distance of two links, and of a link from the floor [m].
        foot_friction: of feet on the ground, Coulomb's coefficient, that a robot on legs may use.
        floor: height of the floor in the base frame [m]; None: there is none.

    Raises:
        SettingsError: a value is not allowed.
    """

    duration: float = 10.0
    period: float = 0.0
    harmonics: int = 5
    starts: int = 3
    seed: int = 0
    comparison: int = 20
    velocity_scale: float = 0.8
    effort_scale: float = 0.8
    position_scale: float = 0.95
    velocity_default: float = 1.0
    acceleration_limit: float = 5.0
    slide_acceleration_limit: float = 1.0
    clearance: float = 0.02
    foot_friction: float = 0.5
    floor: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not math.isfinite(value):
                raise SettingsError(f"{field.name} is {value}; it must be a finite number.")
        for name in ("duration", "velocity_default", "acceleration_limit", "slide_acceleration_limit", "foot_friction"):
            _require(getattr(self, name) > 0.0, name, getattr(self, name), "above 0")
        for name in ("position_scale", "velocity_scale", "effort_scale"):
            _require(0.0 < getattr(self, name) <= 1.0, name, getattr(self, name), "above 0 and up to 1")
        for name in ("period", "clearance"):
            _require(getattr(self, name) >= 0.0, name, getattr(self, name), "0 or more")
        _require(2 <= self.harmonics <= 50, "harmonics", self.harmonics, "from 2 to 50")
        _require(self.starts >= 1, "starts", self.starts, "1 or more")
        _require(self.seed >= 0, "seed", self.seed, "0 or more")
        _require(self.comparison >= 1, "comparison", self.comparison, "1 or more")

    @property
    def base_period(self) -> float:
        """The period that is used [s]."""
        return self.period or self.duration / max(1, round(self.duration / 10.0))


def _require(condition: bool, name: str, value: object, allowed: str) -> None:
    if not condition:
        raise SettingsError(f"{name} is {value}; it must be {allowed}.")
