"""What an effect is, in plain values: its knobs, where it acts, what it depends on, how far it reaches."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any

import numpy as np

from sysid_ros.sample import FloatArray


@dataclass(frozen=True, slots=True)
class Knob:
    """A nonlinear parameter of an effect: a constructor argument that is searched for.

    Attributes:
        name: of the argument. low, high: range of the search [unit]. unit: in words.
        logarithmic: the search goes in equal ratios.
        tried: number of values over the range that a search starts from.
        reach: how far a search goes on each side of such a value [unit], a ratio where it is logarithmic; None for a little more
            than to the next one.
        bumpy: there are several optima near such a value.
        step: of a difference by which a slope is taken, a part of the value where it is logarithmic.
        reported: False for what only smooths a jump.
    """

    name: str
    low: float
    high: float
    unit: str
    logarithmic: bool = True
    tried: int = 8
    reach: float | None = None
    bumpy: bool = False
    step: float = 0.02
    reported: bool = True

    def grid(self) -> list[float]:
        """The values that a search starts from."""
        space = np.geomspace if self.logarithmic else np.linspace
        return [float(x) for x in space(self.low, self.high, self.tried)]

    def around(self, value: float) -> tuple[float, float]:
        """The range in which the optimum near one of them is searched."""
        if self.logarithmic:
            ratio = self.reach or (self.high / self.low) ** (1.1 / (self.tried - 1))
            return max(value / ratio, self.low / 2.0), min(value * ratio, self.high * 2.0)
        reach = self.reach or 1.1 * (self.high - self.low) / (self.tried - 1)
        return max(value - reach, min(value, self.low)), min(value + reach, max(value, self.high))


class Curve(IntEnum):
    """What compiled code makes of a joint's speed and acceleration."""

    ONE = 0
    SPEED = 1
    SIGN = 2
    """Of the speed, smoothed: see :func:`.smoothed_sign.smoothed_sign`."""
    ACCELERATION = 3


class Acts(Enum):
    """Where in the drive train an effect's torque acts."""

    LINK = "link"
    """Behind the gears: bodies, springs, forces. Whatever depends on the load of the gears sees it."""
    DRIVE = "drive"
    """In the gears and the motors: friction, rotors."""
    MEASUREMENT = "measurement"
    """Only between the torque and the message: gains, offsets, delays."""


class Depends(Enum):
    """What an effect's columns depend on beside the motion: who learns more of it makes the columns anew."""

    LOAD = "load"
    """The torque of the links on the gears, as far as it is known."""
    DRIVE = "drive"
    """The torque of the drives, as far as it is known."""
    SENSOR = "sensor"
    """What the sensor adds to that: offsets, gains."""
    LINKS = "links"
    """The inertials of the links, as far as they are known."""
    TEMPERATURE = "temperature"
    """The temperature of the joints."""
    TIME = "time"
    """The time since the recording began: beyond a recording the effect says nothing of itself."""


class Scope(Enum):
    """What one occurrence of an effect belongs to, and which joints it loads."""

    JOINT = "joint"
    """To one joint, and loads no other."""
    LINK = "link"
    """To one joint or its link, and loads others too."""
    ARM = "arm"
    """To the whole arm."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One form of an effect that a search starts from.

    Attributes:
        settings: of its knobs. form: its name among several forms, for messages.
        basis: of an effect that loads several joints: its parameters are ``basis @ theta``, shape (p, m); None for the identity.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    basis: FloatArray | None = None
    form: str = ""


@dataclass(frozen=True)
class DeflectionSearch:
    """How the size of a deflection is found, in which the torque is far from linear.

    The effect has the settings ``around``, the size that its columns are made for, and ``exact``, False for the first order.

    Attributes:
        scanned: ratio on both sides of a first size that is tried.
        steps: settings that are narrowed in turn, each within a ratio of its value; 0: over the whole range of its knob.
        sides: values of the setting ``side`` that are tried. smooth: the torque has slopes to follow.
        form_error: what the model is off by from a real gear, as a part of the size.
    """

    scanned: float
    steps: tuple[tuple[str, float], ...]
    sides: tuple[int, ...] = ()
    smooth: bool = True
    form_error: float = 0.0
