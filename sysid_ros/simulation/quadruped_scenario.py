"""QuadrupedScenario: everything that a simulated recording of the quadruped depends on, checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from sysid_ros.exceptions import SettingsError
from sysid_ros.sample import FloatArray
from sysid_ros.simulation.description import FEET
from sysid_ros.simulation.quadruped_motion import GAITS, WALKS
from sysid_ros.simulation.scenario import Scenario

SETTLE_TIME = 0.5
"""The robot stands for so long before the recording begins [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class QuadrupedScenario(Scenario):
    """What is simulated of the quadruped, which carries the payload on its trunk.

    Attributes:
        gait: 'stand', 'sway', 'trot' or 'turn' (on the spot). extent: factor on the sway's amplitudes. speed: of the trot [m/s].
        slope: of the ground [deg]. slope_heading: direction of the ascent, 0 ahead, 90 to the left [deg].
        controller_knows_payload: else the robot leans under a heavy one.
        lifted_foot: a foot that is held in the air all along; empty: none.
        hoist_time: from then on ropes lift the robot, which holds its legs, off the ground [s]; None: never.
        hoist_duration: until it is set down and free again [s].
        imu_xyz, imu_rpy: where the IMU sits in the trunk [m] and how it is turned [rad].
        gyro_noise, accelerometer_noise: standard deviations [rad/s], [m/s^2].
        gyro_bias, accelerometer_bias: the IMU shows so much more, shape (3,).
        contact_error: share of messages in which one foot's contact is wrong.
        grip: Coulomb coefficient of the feet. sink: how far a foot that carries a quarter of the robot sinks in [m].

    Raises:
        SettingsError: a value is not allowed.
    """

    duration: float = 10.0
    rate: int = 500
    gait: str = "stand"
    extent: float = 1.0
    speed: float = 0.2
    slope: float = 0.0
    slope_heading: float = 0.0
    payload_com: tuple[float, ...] = (0.03, -0.02, 0.1)
    controller_knows_payload: bool = True
    lifted_foot: str = ""
    hoist_time: float | None = None
    hoist_duration: float = 4.0
    imu_xyz: tuple[float, ...] = (0.0, 0.0, 0.0)
    imu_rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    encoder_noise: float = 2e-5
    gyro_noise: float = 0.005
    accelerometer_noise: float = 0.05
    gyro_bias: tuple[float, ...] = (0.0, 0.0, 0.0)
    accelerometer_bias: tuple[float, ...] = (0.0, 0.0, 0.0)
    contact_error: float = 0.0
    grip: float = 0.8
    sink: float = 0.0

    gaits: ClassVar[Sequence[str]] = GAITS

    def __post_init__(self) -> None:
        self.check_motion()
        self.require(self.lifted_foot in ("", *FEET), "lifted_foot", f"one of {', '.join(FEET)}")
        self.require(not (self.lifted_foot and self.gait in WALKS), "lifted_foot", "empty in a trot and a turn")
        hoisted = self.hoist_time is None or (0.0 <= self.hoist_time < self.duration and self.gait not in WALKS)
        self.require(hoisted, "hoist_time", "from 0 s to before the end, and not in a trot or a turn")
        self.require(2.5 <= self.hoist_duration < math.inf, "hoist_duration", "2.5 s or more")
        x, y, z = self.payload_com
        near = abs(x) <= 0.15 and abs(y) <= 0.08 and 0.0 <= z <= 0.4
        place = "on the back: x within 0.15 m, y within 0.08 m and z from 0 to 0.4 m of the trunk's origin"
        self.check_payload(6.0, "robot", near, place)

    def check_motion(self) -> None:
        """What robot, ground and sensors do is allowed.

        Raises:
            SettingsError: it is not.
        """
        self.check_values(100, ("imu_xyz", "imu_rpy", "gyro_bias", "accelerometer_bias"))
        self.require(self.gait in self.gaits, "gait", f"one of {', '.join(self.gaits)}")
        self.require(0.0 <= self.extent <= 1.5, "extent", "from 0 to 1.5")
        self.require(0.0 <= self.speed <= 0.4, "speed", "from 0 to 0.4 m/s")
        self.require(0.0 <= self.slope <= 10.0, "slope", "from 0 to 10 degrees")
        self.require(math.isfinite(self.slope_heading), "slope_heading", "a finite number of degrees")
        self.require(0.0 <= self.contact_error <= 0.5, "contact_error", "from 0 to 0.5")
        self.require(0.2 <= self.grip <= 2.0, "grip", "from 0.2 to 2")
        self.require(0.0 <= self.sink <= 0.05, "sink", "from 0 to 0.05 m")

    @property
    def ground(self) -> FloatArray:
        """Rotation (3, 3) from the ground's axes, x ahead and z its normal, to the world's."""
        angle, heading = math.radians(self.slope), math.radians(self.slope_heading)
        axis = np.array([math.sin(heading), -math.cos(heading), 0.0])
        cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
        return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)


def fallen(scenario: QuadrupedScenario, t: float) -> SettingsError:
    """What is said of a robot that has fallen at t [s]."""
    return SettingsError(
        f"payload_mass is {scenario.payload_mass} at {scenario.payload_com}, and the robot has fallen at {t:.2f} s. Take a "
        "lighter payload, nearer to the middle of the back, a smaller slope or a lower speed."
    )
