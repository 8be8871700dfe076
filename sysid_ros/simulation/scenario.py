"""Scenario, ArmScenario: everything that a simulated recording depends on, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
class Scenario:
    """What every simulated recording depends on; the same scenario gives the same numbers.

    Attributes:
        seed: of the motion and of the noise.
        duration: [s]; infinite only for a live run.
        rate: messages a second, a divisor of 1000; the physics and the control always run at 1000.
        payload_mass: [kg]; None: there is no payload.
        payload_com: centre of mass in the frame of the link that carries it, shape (3,) [m].
        payload_size: edges of the box whose inertia it has, shape (3,) [m]; None: a box of about 2000 kg/m^3.
        payload_rpy: how that box is turned in the link's frame, shape (3,) [rad].
        pick_time, drop_time: since the start [s]; None: carried from the start, never dropped. Infinite: not by itself.
        controller_knows_payload: the controller's model has the payload while it is carried.
        encoder_noise, torque_noise, velocity_noise: standard deviations [rad], [N m], [rad/s].
    """

    seed: int = 0
    duration: float
    rate: int
    payload_mass: float | None = None
    payload_com: tuple[float, ...]
    payload_size: tuple[float, ...] | None = None
    payload_rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    pick_time: float | None = None
    drop_time: float | None = None
    controller_knows_payload: bool
    encoder_noise: float
    torque_noise: float = 0.1
    velocity_noise: float = 1e-3

    def require(self, condition: bool, name: str, allowed: str) -> None:
        """What is allowed of a setting holds.

        Raises:
            SettingsError: it does not.
        """
        if not condition:
            value = getattr(self, name)
            raise SettingsError(f"{name} is {'missing' if value is None else value}; it must be {allowed}.")

    def check_values(self, least_rate: int, vectors: Sequence[str]) -> None:
        """Numbers are numbers and within their ranges; ``vectors`` names what else has three.

        Raises:
            SettingsError: one is not.
        """
        for setting in fields(self):
            value = getattr(self, setting.name)
            for x in value if isinstance(value, tuple) else (value,):
                self.require(not (isinstance(x, float) and math.isnan(x)), setting.name, "a number")
            if setting.name.endswith("_noise"):
                self.require(0.0 <= value < math.inf, setting.name, "0 or more")
        self.require(self.seed >= 0, "seed", "0 or more")
        self.require(self.duration >= 1.0, "duration", "1 s or more")
        rates = [str(rate) for rate in (1000, 500, 250, 200, 125, 100)]
        allowed = self.rate >= least_rate and CONTROL_RATE % self.rate == 0
        at_least = f" from {least_rate}" if least_rate > 1 else ""
        self.require(allowed, "rate", f"a divisor of 1000 Hz{at_least}: {', '.join(rates)}, ...")
        for name in ("payload_com", "payload_rpy", "payload_size", *vectors):
            value = getattr(self, name)
            self.require(value is None or (len(value) == 3 and all(map(math.isfinite, value))), name, "three finite numbers")

    def check_payload(self, heaviest: float, robot: str, near: bool, where: str) -> None:
        """The payload, where there is one, can be carried: up to ``heaviest`` [kg]; ``near`` and ``where`` are of its place.

        Raises:
            SettingsError: it can't.
        """
        if self.payload_mass is None:
            alone = self.pick_time is None and self.drop_time is None
            self.require(alone, "payload_mass", "given where pick_time or drop_time is")
            return
        light = 0.0 < self.payload_mass <= heaviest
        self.require(light, "payload_mass", f"above 0 and up to {heaviest:g} kg; leave it out for an empty {robot}")
        self.require(near, "payload_com", where)
        self.require(self.payload_size is None or min(self.payload_size) > 0.0, "payload_size", "three positive edges")
        pick = 0.0 if self.pick_time is None else self.pick_time
        self.require(pick >= 0.0, "pick_time", "0 s or later")
        self.require(pick < self.duration or math.isinf(pick), "pick_time", f"before the end at {self.duration:g} s")
        if self.drop_time is not None and math.isfinite(self.drop_time):
            self.require(self.drop_time > pick, "drop_time", f"after the pick at {pick:g} s")
            self.require(self.drop_time < self.duration, "drop_time", f"before the end at {self.duration:g} s")

    @property
    def payload(self) -> Payload | None:
        """The body that is carried."""
        if self.payload_mass is None:
            return None
        return box(self.payload_mass, self.payload_com, self.payload_size, self.payload_rpy)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmScenario(Scenario):
    """What is simulated of an arm, which carries the payload at its tip link.

    Attributes:
        base_frequency: of the exciting motion [Hz].
        velocity: the messages hold the velocity.
        viscous_friction, coulomb_friction, rotor_inertia, torque_offset: one value for all joints or one a joint
            [N m s/rad], [N m], [kg m^2], [N m]; the offset is what the torque sensor shows more than the torque.

    Raises:
        SettingsError: a value is not allowed.
    """

    duration: float = 15.0
    rate: int = CONTROL_RATE
    payload_com: tuple[float, ...] = (0.03, -0.02, 0.08)
    controller_knows_payload: bool = False
    base_frequency: float = 0.2
    encoder_noise: float = 1e-5
    velocity: bool = True
    viscous_friction: tuple[float, ...] = _ALIKE
    coulomb_friction: tuple[float, ...] = _ALIKE
    rotor_inertia: tuple[float, ...] = _ALIKE
    torque_offset: tuple[float, ...] = field(default=_ALIKE, metadata={"signed": True})

    def __post_init__(self) -> None:
        self.check_values(1, ())
        for setting in self.joint_settings():
            self.require("signed" in setting.metadata or min(getattr(self, setting.name)) >= 0.0, setting.name, "0 or more")
        self.require(0.01 <= self.base_frequency <= 1.0, "base_frequency", "from 0.01 to 1 Hz")
        near = max(map(abs, self.payload_com)) <= 1.0
        self.check_payload(20.0, "arm", near, "within 1 m of the tip link's origin")

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
        self.require(len(values) in (1, n), name, f"1 value for all joints or {n}, one a joint")
        return np.broadcast_to(np.asarray(values, dtype=float), (n,)).copy()
