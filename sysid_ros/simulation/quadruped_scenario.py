"""QuadrupedScenario: everything that a simulated recording of the quadruped depends on, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from sysid_ros.sample import FloatArray
from sysid_ros.simulation.payload import Payload, box
from sysid_ros.simulation.quadruped_description import FEET
from sysid_ros.simulation.quadruped_motion import GAITS
from sysid_ros.simulation.scenario import CONTROL_RATE, require, require_numbers

SETTLE_TIME = 0.5
"""The robot stands for so long before the recording begins [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class QuadrupedScenario:
    """What is simulated; the same scenario gives the same numbers.

    Attributes:
        seed: of the motion and of the noise. duration: [s]; infinite only for a live run.
        rate: messages a second, a divisor of 1000; the physics and the control always run at 1000.
        gait: 'stand', 'sway' or 'trot'. extent: factor on the sway's amplitudes. speed: of the trot [m/s].
        slope: of the ground [deg]. slope_heading: direction of the ascent, 0 ahead, 90 to the left [deg].
        payload_mass: [kg]; None: nothing is on the back.
        payload_com: centre of mass in the trunk's frame, shape (3,) [m].
        payload_size: edges of the box, shape (3,) [m]; None: a box of about 2000 kg/m^3. payload_rpy: how it is turned [rad].
        pick_time, drop_time: when it is put on and taken off [s]; None: carried from the start, never taken off.
        controller_knows_payload: its model has the box while it is on; else the robot leans under a heavy one.
        lifted_foot: a foot that is held in the air all along; empty: none.
        hoist_time: from then on ropes lift the robot, which holds its legs, off the ground [s]; None: never. hoist_duration:
        until it
            is set down and free again [s].
        imu_xyz, imu_rpy: where the IMU sits in the trunk [m] and how it is turned [rad].
        encoder_noise, velocity_noise, torque_noise, gyro_noise, accelerometer_noise: standard deviations of a message's values
            [rad], [rad/s], [N m], [rad/s], [m/s^2]. gyro_bias, accelerometer_bias: the IMU shows so much more, shape (3,).
        contact_error: share of messages in which one foot's contact is told wrong.

    Raises:
        SettingsError: a value is not allowed.
    """

    seed: int = 0
    duration: float = 10.0
    rate: int = 500
    gait: str = "stand"
    extent: float = 1.0
    speed: float = 0.2
    slope: float = 0.0
    slope_heading: float = 0.0
    payload_mass: float | None = None
    payload_com: tuple[float, ...] = (0.03, -0.02, 0.1)
    payload_size: tuple[float, ...] | None = None
    payload_rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    pick_time: float | None = None
    drop_time: float | None = None
    controller_knows_payload: bool = True
    lifted_foot: str = ""
    hoist_time: float | None = None
    hoist_duration: float = 4.0
    imu_xyz: tuple[float, ...] = (0.0, 0.0, 0.0)
    imu_rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    encoder_noise: float = 2e-5
    velocity_noise: float = 1e-3
    torque_noise: float = 0.1
    gyro_noise: float = 0.005
    accelerometer_noise: float = 0.05
    gyro_bias: tuple[float, ...] = (0.0, 0.0, 0.0)
    accelerometer_bias: tuple[float, ...] = (0.0, 0.0, 0.0)
    contact_error: float = 0.0

    def __post_init__(self) -> None:
        require_numbers({field.name: getattr(self, field.name) for field in fields(self)})
        self._require(self.seed >= 0, "seed", "0 or more")
        self._require(self.duration >= 1.0, "duration", "1 s or more")
        self._require(
            self.rate >= 100 and CONTROL_RATE % self.rate == 0, "rate", "a divisor of 1000 Hz from 100: 1000, 500, 250, 200, ..."
        )
        self._require(self.gait in GAITS, "gait", f"one of {', '.join(GAITS)}")
        self._require(0.0 <= self.extent <= 1.5, "extent", "from 0 to 1.5")
        self._require(0.0 <= self.speed <= 0.4, "speed", "from 0 to 0.4 m/s")
        self._require(0.0 <= self.slope <= 10.0, "slope", "from 0 to 10 degrees")
        self._require(math.isfinite(self.slope_heading), "slope_heading", "a finite number of degrees")
        self._require(self.lifted_foot in ("", *FEET), "lifted_foot", f"one of {', '.join(FEET)}")
        self._require(not (self.lifted_foot and self.gait == "trot"), "lifted_foot", "empty in a trot")
        self._require(
            self.hoist_time is None or (0.0 <= self.hoist_time < self.duration and self.gait != "trot"),
            "hoist_time",
            "from 0 s to before the end, and not in a trot",
        )
        self._require(2.5 <= self.hoist_duration < math.inf, "hoist_duration", "2.5 s or more")
        for name in ("encoder_noise", "velocity_noise", "torque_noise", "gyro_noise", "accelerometer_noise"):
            self._require(0.0 <= getattr(self, name) < math.inf, name, "0 or more")
        self._require(0.0 <= self.contact_error <= 0.5, "contact_error", "from 0 to 0.5")
        for name in ("payload_com", "payload_rpy", "payload_size", "imu_xyz", "imu_rpy", "gyro_bias", "accelerometer_bias"):
            value = getattr(self, name)
            self._require(value is None or (len(value) == 3 and all(map(math.isfinite, value))), name, "three finite numbers")
        self._check_payload()

    def _check_payload(self) -> None:
        if self.payload_mass is None:
            self._require(
                self.pick_time is None and self.drop_time is None, "payload_mass", "given where pick_time or drop_time is"
            )
            return
        self._require(0.0 < self.payload_mass <= 6.0, "payload_mass", "above 0 and up to 6 kg; leave it out for an empty robot")
        x, y, z = self.payload_com
        self._require(
            abs(x) <= 0.15 and abs(y) <= 0.08 and 0.0 <= z <= 0.4,
            "payload_com",
            "on the back: x within 0.15 m, y within 0.08 m and z from 0 to 0.4 m of the trunk's origin",
        )
        self._require(self.payload_size is None or min(self.payload_size) > 0.0, "payload_size", "three positive edges")
        pick = 0.0 if self.pick_time is None else self.pick_time
        self._require(pick >= 0.0 and (pick < self.duration or math.isinf(pick)), "pick_time", "from 0 s to before the end")
        if self.drop_time is not None and math.isfinite(self.drop_time):
            self._require(pick < self.drop_time < self.duration, "drop_time", f"after the pick at {pick:g} s and before the end")

    def _require(self, condition: bool, name: str, allowed: str) -> None:
        require(condition, name, getattr(self, name), allowed)

    @property
    def payload(self) -> Payload | None:
        """The box that is put on the back."""
        if self.payload_mass is None:
            return None
        return box(self.payload_mass, self.payload_com, self.payload_size, self.payload_rpy)

    @property
    def ground(self) -> FloatArray:
        """Rotation (3, 3) from the ground's axes, x ahead and z its normal, to the world's."""
        angle, heading = math.radians(self.slope), math.radians(self.slope_heading)
        axis = np.array([math.sin(heading), -math.cos(heading), 0.0])
        cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
        return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)
