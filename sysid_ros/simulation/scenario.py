"""ArmScenario: everything that a simulated recording depends on, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.payload import Payload, box

CONTROL_RATE = 1000
"""Steps of the physics and of the controller a second."""
_ALIKE = (0.0,)
"""Default of a setting that has one value for all joints or one a joint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmScenario:
    """What is simulated; the same scenario gives the same numbers.

    Attributes:
        seed: of the motion and of the noise.
        duration: [s]; infinite only for a live run.
        rate: messages a second, a divisor of 1000; the physics and the control always run at 1000.
        payload_mass: [kg]; None: there is no payload.
        payload_com: centre of mass in the tip link's frame, shape (3,) [m].
        payload_size: edges of the box whose inertia it has, shape (3,) [m]; None: a box of about 2000 kg/m^3.
        payload_rpy: how that box is turned in the tip link's frame, shape (3,) [rad].
        pick_time, drop_time: since the start [s]; None: carried from the start, never dropped. Infinite: not by itself.
        controller_knows_payload: the controller's model has the payload while it is carried.
        base_frequency: of the exciting motion [Hz].
        encoder_noise: standard deviation of the positions [rad].
        torque_noise: standard deviation of the torques [N m].
        velocity: the messages hold the velocity.
        velocity_noise: its standard deviation [rad/s].
        viscous_friction, coulomb_friction, rotor_inertia, torque_offset: one value for all joints or one a joint
            [N m s/rad], [N m], [kg m^2], [N m]; the offset is what the torque sensor shows more than the torque.

    Raises:
        SettingsError: a value is not allowed.
    """

    seed: int = 0
    duration: float = 15.0
    rate: int = CONTROL_RATE
    payload_mass: float | None = None
    payload_com: tuple[float, ...] = (0.03, -0.02, 0.08)
    payload_size: tuple[float, ...] | None = None
    payload_rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    pick_time: float | None = None
    drop_time: float | None = None
    controller_knows_payload: bool = False
    base_frequency: float = 0.2
    encoder_noise: float = 1e-5
    torque_noise: float = 0.1
    velocity: bool = True
    velocity_noise: float = 1e-3
    viscous_friction: tuple[float, ...] = _ALIKE
    coulomb_friction: tuple[float, ...] = _ALIKE
    rotor_inertia: tuple[float, ...] = _ALIKE
    torque_offset: tuple[float, ...] = field(default=_ALIKE, metadata={"signed": True})

    def __post_init__(self) -> None:
        require_numbers({setting.name: getattr(self, setting.name) for setting in fields(self)})
        require(self.seed >= 0, "seed", self.seed, "0 or more")
        require(self.duration >= 1.0, "duration", self.duration, "1 s or more")
        require(
            self.rate > 0 and CONTROL_RATE % self.rate == 0,
            "rate",
            self.rate,
            "a divisor of 1000 Hz: 1000, 500, 250, 200, 125, 100, ...",
        )
        for name in ("encoder_noise", "torque_noise", "velocity_noise"):
            require(0.0 <= getattr(self, name) < math.inf, name, getattr(self, name), "0 or more")
        for setting in self.joint_settings():
            values = getattr(self, setting.name)
            require("signed" in setting.metadata or min(values) >= 0.0, setting.name, values, "0 or more")
        require(0.01 <= self.base_frequency <= 1.0, "base_frequency", self.base_frequency, "from 0.01 to 1 Hz")
        self._check_payload()

    def _check_payload(self) -> None:
        for name in ("payload_com", "payload_rpy", "payload_size"):
            value = getattr(self, name)
            require(value is None or (len(value) == 3 and all(map(math.isfinite, value))), name, value, "three finite numbers")
        if self.payload_mass is None:
            require(
                self.pick_time is None and self.drop_time is None,
                "payload_mass",
                "missing",
                "given where pick_time or drop_time is",
            )
            return
        require(
            0.0 < self.payload_mass <= 20.0,
            "payload_mass",
            self.payload_mass,
            "above 0 and up to 20 kg; leave it out for an empty arm",
        )
        require(max(map(abs, self.payload_com)) <= 1.0, "payload_com", self.payload_com, "within 1 m of the tip link's origin")
        require(
            self.payload_size is None or min(self.payload_size) > 0.0, "payload_size", self.payload_size, "three positive edges"
        )
        pick = 0.0 if self.pick_time is None else self.pick_time
        require(pick >= 0.0, "pick_time", pick, "0 s or later")
        require(pick < self.duration or math.isinf(pick), "pick_time", pick, f"before the end at {self.duration:g} s")
        if self.drop_time is not None and math.isfinite(self.drop_time):
            require(self.drop_time > pick, "drop_time", self.drop_time, f"after the pick at {pick:g} s")
            require(self.drop_time < self.duration, "drop_time", self.drop_time, f"before the end at {self.duration:g} s")

    @property
    def payload(self) -> Payload | None:
        """The body that is picked up."""
        if self.payload_mass is None:
            return None
        return box(self.payload_mass, self.payload_com, self.payload_size, self.payload_rpy)

    @classmethod
    def joint_settings(cls) -> list[Field[Any]]:
        """Settings with one value for all joints or one a joint."""
        return [setting for setting in fields(cls) if setting.default == _ALIKE]

    def per_joint(self, name: str, n: int) -> FloatArray:
        """One of the four joint settings as an array of shape (n,).

        Raises:
            SettingsError: neither 1 nor n values were given.
        """
        values: tuple[float, ...] = getattr(self, name)
        require(len(values) in (1, n), name, values, f"1 value for all joints or {n}, one a joint")
        return np.broadcast_to(np.asarray(values, dtype=float), (n,)).copy()


def require_numbers(settings: Mapping[str, object]) -> None:
    """No setting, and nothing in one that is a tuple, is NaN.

    Raises:
        SettingsError: one is.
    """
    for name, value in settings.items():
        for x in value if isinstance(value, tuple) else (value,):
            require(not (isinstance(x, float) and math.isnan(x)), name, value, "a number")


def require(condition: bool, name: str, value: object, allowed: str) -> None:
    """What is allowed of a setting holds.

    Raises:
        SettingsError: it does not.
    """
    if not condition:
        raise SettingsError(f"{name} is {value}; it must be {allowed}.")
