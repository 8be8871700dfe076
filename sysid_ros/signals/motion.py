"""Motion: a whole recording on an even grid, with what the robot's model says of it."""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.zero_phase import low_passed


class Motion:
    """Channels of a recording after filtering, shape (N, n) each, on an even grid of times.

    Args:
        robot: the nominal model.
        t: shape (N,) [s], since the recording's first stamp.
        q, v, a: positions, velocities and accelerations. tau: measured torque.
        link_torque: torque that the links need, as far as it is known; None for the URDF's.
        drive_torque: torque that the drives give, friction included, as far as it is known; None for that of the links.
        held_torque: as :attr:`held_torque`; None where that is not known.
        sensor_torque: as :attr:`sensor_torque`; None for nothing.
        temperature: of the joints [degrees Celsius], NaN where it is not known; None where none is.

    Attributes:
        period: of the grid [s].
        clear: frequency up to which each position stands above its noise, shape (n,) [Hz]; None where that is not known.
        recording: name of the recording that it is a stretch of.
        by_radius: of a robot on legs, what a metre of the radius of each foot does to the six rows of its trunk, shape (N, 6, k)
            [N/m], [N]; else None.
    """

    def __init__(
        self,
        robot: RobotModel,
        t: FloatArray,
        q: FloatArray,
        v: FloatArray,
        a: FloatArray,
        tau: FloatArray,
        link_torque: FloatArray | None = None,
        drive_torque: FloatArray | None = None,
        temperature: FloatArray | None = None,
        held_torque: FloatArray | None = None,
        sensor_torque: FloatArray | None = None,
    ) -> None:
        self.robot, self.t, self.q, self.v, self.a, self.tau = robot, t, q, v, a, tau
        self.temperature = temperature
        self._link_torque, self._drive_torque, self._held_torque = link_torque, drive_torque, held_torque
        self._sensor_torque = sensor_torque
        self.clear: FloatArray | None = None
        self.recording = ""
        self.by_radius: FloatArray | None = None
        self._payload: dict[str, FloatArray] = {}
        self._joints: dict[int, Motion] = {}
        self._clear_load: dict[tuple[int, float], FloatArray] = {}
        self._carrying: dict[bytes, Motion] = {}
        self._own_sensitivity: dict[int, tuple[FloatArray, FloatArray, FloatArray]] = {}

    @property
    def period(self) -> float:
        """Spacing of the grid [s]."""
        return float(self.t[1] - self.t[0])

    @cached_property
    def link_torque(self) -> FloatArray:
        """Torque on the link side of the joints, shape (N, n) [N m]."""
        return self.rigid_torque if self._link_torque is None else self._link_torque

    @cached_property
    def rigid_torque(self) -> FloatArray:
        """Torque of the URDF's links, shape (N, n) [N m]."""
        return self.robot.rnea_along(self.q, self.v, self.a)

    @property
    def drive_torque(self) -> FloatArray:
        """Torque on the motor side, referred to the joints, shape (N, n) [N m]."""
        return self.link_torque if self._drive_torque is None else self._drive_torque

    @property
    def held_torque(self) -> FloatArray:
        """Torque on the motor side, but as it was measured where a joint stands, as dry friction holds any torque there; shape
        (N, n) [N m]."""
        return self.drive_torque if self._held_torque is None else self._held_torque

    @property
    def sensor_torque(self) -> FloatArray:
        """What the sensor adds to the torque on the motor side by an offset or a gain, shape (N, n) [N m]."""
        return np.zeros_like(self.tau) if self._sensor_torque is None else self._sensor_torque

    @cached_property
    def regressor(self) -> FloatArray:
        """Of all links, shape (N, n, 10 n)."""
        return self.robot.regressor_along(self.q, self.v, self.a)

    @cached_property
    def sensitivity(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives of the link torque by q, v and a, shape (N, n, n) each."""
        return self.robot.rnea_derivatives_along(self.q, self.v, self.a)

    def own_sensitivity(self, joint: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of the link torque of one joint by its own q, v and a, shape (N,) each."""
        if joint not in self._own_sensitivity:
            by_q, by_v, by_a = (np.ascontiguousarray(x[:, joint, joint]) for x in self.sensitivity)
            self._own_sensitivity[joint] = by_q, by_v, by_a
        return self._own_sensitivity[joint]

    @cached_property
    def gravity_torque(self) -> FloatArray:
        """Torque that holds the links against gravity, shape (N, n) [N m]."""
        nothing = np.zeros_like(self.q)
        return self.robot.rnea_along(self.q, nothing, nothing)

    @cached_property
    def base_mass(self) -> FloatArray:
        """Torque that a unit of acceleration of the base costs along each of its axes, shape (N, n, 3)."""
        return np.stack([self.robot.base_acceleration_columns(q) for q in self.q])

    def payload_regressor(self, frame: str) -> FloatArray:
        """Of a body fixed to a frame, shape (N, n, 10)."""
        if frame not in self._payload:
            index, robot = self.robot.frame_id(frame), self.robot
            rows = [robot.payload_regressor(q, v, a, index) for q, v, a in zip(self.q, self.v, self.a, strict=True)]
            self._payload[frame] = np.stack(rows)
        return self._payload[frame]

    def clear_load(self, joint: int) -> FloatArray:
        """Link torque of one joint without what only the noise of the positions makes of it, shape (N,) [N m]."""
        load = np.ascontiguousarray(self.link_torque[:, joint])
        edge = np.inf if self.clear is None else float(np.min(self.clear[self.clear > 0.0], initial=np.inf))
        if edge >= 0.4 / self.period or len(load) < 60:
            return load
        key = joint, max(edge, 1.0)
        if key not in self._clear_load:
            self._clear_load[key] = low_passed(load, key[1], self.period)
        return self._clear_load[key]

    def rate_of(self, values: FloatArray) -> FloatArray:
        """Derivative by time of values on the grid, along the first axis."""
        return np.asarray(np.gradient(values, self.period, axis=0))

    def with_torques(
        self,
        link_torque: FloatArray,
        drive_torque: FloatArray,
        held_torque: FloatArray | None = None,
        sensor_torque: FloatArray | None = None,
    ) -> Motion:
        """The same motion with more known of its torques, shape (N, n) each; what was computed from the motion alone is kept."""
        known = link_torque, drive_torque, self.temperature, held_torque, sensor_torque
        other = Motion(self.robot, self.t, self.q, self.v, self.a, self.tau, *known)
        for name in ("regressor", "sensitivity", "gravity_torque", "rigid_torque", "base_mass"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        other._payload, other.clear, other.recording = self._payload, self.clear, self.recording
        other._carrying, other._own_sensitivity = self._carrying, self._own_sensitivity
        other.by_radius = self.by_radius
        return other

    def less(self, torque: FloatArray) -> Motion:
        """The same motion with so much less of the measured torque, shape (N, n) [N m]."""
        other = copy(self)
        other.tau, other._joints, other._carrying = self.tau - torque, {}, {}
        return other

    def carrying(self, arm: RobotModel) -> Motion:
        """The same motion of an arm with other links, with what is known of its torques: these are not those of the links alone.

        What was computed of the last arm that was asked for is kept.
        """
        if arm is self.robot:
            return self
        key = arm.pi.tobytes()
        if key not in self._carrying:
            other = Motion(arm, self.t, self.q, self.v, self.a, self.tau, temperature=self.temperature)
            other.clear, other.recording, other.by_radius = self.clear, self.recording, self.by_radius
            assert other.sensitivity[0].shape == other.rigid_torque.shape + other.rigid_torque.shape[1:]
            self._carrying.clear()
            self._carrying[key] = other
        return self._carrying[key].with_torques(self.link_torque, self.drive_torque, self._held_torque, self._sensor_torque)

    def of_joint(self, joint: int) -> Motion:
        """The channels of one joint alone, shape (N, 1) each: for curves that depend on nothing but that joint."""
        if joint not in self._joints:
            one = slice(joint, joint + 1)
            channels = (x[:, one] for x in (self.q, self.v, self.a, self.tau, self.link_torque, self.drive_torque))
            self._joints[joint] = Motion(self.robot, self.t, *channels)
            self._joints[joint]._sensor_torque = self.sensor_torque[:, one]
            self._joints[joint].temperature = None if self.temperature is None else self.temperature[:, one]
        return self._joints[joint]

    def samples(self) -> list[Sample]:
        """The grid's points one by one."""
        warm = self.temperature
        return [
            Sample(float(self.t[i]), self.q[i], self.v[i], self.a[i], self.tau[i], None if warm is None else warm[i])
            for i in range(len(self.t))
        ]
