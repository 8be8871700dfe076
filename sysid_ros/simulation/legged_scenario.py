"""LeggedScenario: everything that a recording of a robot on legs in MuJoCo depends on, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from sysid_ros.simulation.gait_sequence import MIXED
from sysid_ros.simulation.legged_gait import LEGGED_GAITS
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario
from sysid_ros.simulation.scenario import CONTROL_RATE

OWN = (
    "robot", "leg_friction", "leg_damping", "rotor_inertia", "mass_error", "foot_spheres", "encoder_step", "imu_rate",
    "imu_delay", "imu_low_pass", "imu_tilt", "imu_lever", "contact_delay", "push_time", "trunk_com", "motion", "stairs",
    "shift_time",
)  # fmt: skip
"""Settings that only this simulator has."""

SHIFT = (0.04, 0.03, 0.0)
"""By how much a load slips, 5 cm [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeggedScenario(QuadrupedScenario):
    """What is simulated of a robot on legs whose joints hold wanted positions, so that feet strike the ground.

    Of :class:`.QuadrupedScenario` what a controller of torques does is not there: ``controller_knows_payload``, ``lifted_foot``
    and the ropes of ``hoist_time``.

    Attributes:
        robot: its name among the packaged ones, or the path of its URDF. gait: one of :data:`.LEGGED_GAITS`, or 'mixed'.
        leg_friction, leg_damping, rotor_inertia: of the joints on the mean [N m], [N m s/rad], [kg m^2]; each joint has from 0.7
            to 1.3 times as much, and the efforts are the motors'.
        mass_error: standard deviation of each link's mass beside that of the description, as a part of it.
        trunk_com: by how much the trunk's centre of mass lies elsewhere than the description says, shape (3,) [m].
        foot_spheres: the description tells what the feet are.
        encoder_step: of the positions [rad].
        imu_rate: messages of the IMU a second, a divisor of 1000; 0: those of the joints. imu_delay: of their stamps [s].
        imu_low_pass: False: it shows the force of one millisecond, in place of the mean since the message before.
        imu_tilt: how it is turned beside what the description tells, roll, pitch, yaw, shape (3,) [rad].
        imu_lever: where it sits beside what the description tells, shape (3,) [m].
        contact_delay: of the messages of the feet [s].
        motion: path of a joint trajectory that is followed instead of a gait, as ``sysid excite`` writes it; empty: none.
        stairs: rise of steps that go up and down, ahead and behind [m]; 0: the ground is even.
        shift_time: the load slips to ``SHIFT`` beside its place then [s]; None: never.
        push_time: the trunk is pushed to the side for 0.3 s with a quarter of the weight [s]; None: never.

    Raises:
        SettingsError: a value is not allowed.
    """

    robot: str = "a1"
    leg_friction: float = 0.0
    leg_damping: float = 0.0
    rotor_inertia: float = 0.0
    mass_error: float = 0.0
    trunk_com: tuple[float, ...] = (0.0, 0.0, 0.0)
    foot_spheres: bool = True
    encoder_step: float = 0.0
    imu_rate: int = 0
    imu_delay: float = 0.0
    imu_low_pass: bool = True
    imu_tilt: tuple[float, ...] = (0.0, 0.0, 0.0)
    imu_lever: tuple[float, ...] = (0.0, 0.0, 0.0)
    contact_delay: float = 0.0
    push_time: float | None = None
    motion: str = ""
    stairs: float = 0.0
    shift_time: float | None = None
    gaits: ClassVar[Sequence[str]] = (*LEGGED_GAITS, MIXED)

    def __post_init__(self) -> None:
        self.check_motion()
        self.require(self.lifted_foot == "", "lifted_foot", "empty with MuJoCo, whose gait 'step' lifts one foot after the other")
        self.require(self.hoist_time is None, "hoist_time", "left out with MuJoCo")
        self.require(
            self.controller_knows_payload, "controller_knows_payload", "left out with MuJoCo, where joints hold positions"
        )
        for name, most in (("leg_friction", 20.0), ("leg_damping", 20.0), ("rotor_inertia", 1.0), ("encoder_step", 0.1)):
            self.require(0.0 <= getattr(self, name) <= most, name, f"from 0 to {most:g}")
        self.require(0.0 <= self.mass_error <= 0.2, "mass_error", "from 0 to 0.2")
        self.require(self.imu_rate == 0 or (self.imu_rate >= 50 and CONTROL_RATE % self.imu_rate == 0), "imu_rate",
                     "0, or a divisor of 1000 Hz from 50")  # fmt: skip
        for name in ("imu_delay", "contact_delay"):
            self.require(0.0 <= getattr(self, name) <= 0.1, name, "from 0 to 0.1 s")
        for name in ("imu_tilt", "imu_lever", "trunk_com"):
            value = getattr(self, name)
            self.require(len(value) == 3 and all(abs(x) <= 0.5 for x in value), name, "three numbers from -0.5 to 0.5")
        self.require(
            not self.motion or self.gait == "stand", "motion", "left out with a gait: the robot follows one or the other"
        )
        self.require(0.0 <= self.stairs <= 0.15, "stairs", "from 0 to 0.15 m")
        shifted = self.shift_time is None or (self.payload_mass is not None and 0.0 <= self.shift_time < self.duration)
        self.require(shifted, "shift_time", "from 0 s to before the end, of a robot that carries something")
        pushed = self.push_time is None or 0.0 <= self.push_time < self.duration
        self.require(pushed, "push_time", "from 0 s to before the end")
        near = all(map(math.isfinite, self.payload_com)) and max(map(abs, self.payload_com)) <= 0.6
        self.check_payload(60.0, "robot", near, "within 0.6 m of the trunk's origin")
