"""QuadrupedController: inverse dynamics of the trunk over the feet that stand, by joint torques."""

from __future__ import annotations

import math

import numpy as np

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.sample import FREE, FloatArray
from sysid_ros.simulation.quadruped_motion import Trot, TrunkMotion
from sysid_ros.simulation.trunk_state import TrunkState

_STANCE_RAMP = 0.15
_FRICTION = 0.6
_LEAST_FORCE = 4.0


class QuadrupedController:
    """Holds the trunk on its way and, in a trot, sets the feet.

    Wanted accelerations of trunk and feet (feedback around the reference) give the wrench on the trunk by inverse dynamics; the
    feet that stand share it in the least-squares sense, each within its friction cone, and more gently just after it landed and
    before it lifts::

        sum_i J_bi' f_i = rnea_trunk,      tau = rnea_joints - sum_i J_li' f_i

    Feet land where they keep the trunk over them (Raibert 1986, section 2). Everything is in the axes of the trunk; the reference
    is in those of the ground.

    Args:
        base: what the controller believes: the robot without a load. motion: of the trunk. trot: None where all feet stay.
        ground: rotation from the ground's axes to the world's, shape (3, 3).

    Attributes:
        lifted: index of a foot that is held in the air, or None. load: ten parameters of a load that the controller knows of.
    """

    _LINEAR = (180.0, 24.0, 250.0)
    _ANGULAR = (250.0, 28.0, 250.0)
    _FOOT = (900.0, 55.0)
    _JOINT = (150.0, 3.0)
    _LIFT = 0.06

    def __init__(self, base: FloatingBase, motion: TrunkMotion, trot: Trot | None, ground: FloatArray) -> None:
        self._base, self._motion, self._trot, self._ground = base, motion, trot, ground
        self._gravity = ground.T @ np.array([0.0, 0.0, -9.81])
        self._k = len(base.contact_frames)
        self._linear_sum, self._angular_sum = np.zeros(3), np.zeros(3)
        self._place, self._yaw, self._offset = np.zeros(2), 0.0, np.zeros(2)
        self._lifted_from = np.zeros((self._k, 3))
        self._swinging = np.zeros(self._k, dtype=bool)
        self.lifted: int | None = None
        self._held: FloatArray | None = None
        self.load = np.zeros(10)
        self._frame = base.robot.frame_id(base.trunk)
        _, jacobians = base.contacts.jacobians(np.full(base.robot.n, 0.3))
        self._leg_rows = np.array([np.flatnonzero(np.abs(j[:3, FREE:]).max(axis=0) > 1e-9) for j in jacobians])

    def start(self, place: FloatArray, hips: FloatArray) -> None:
        """Begin at a place on the ground (2,) [m] with feet neutrally at ``hips`` (k, 2) [m] in the trunk."""
        self._place = place.copy()
        slide = self._motion.height * self._gravity[:2] / self._gravity[2]
        self._hips = hips - slide
        self._slide = slide

    def torque(self, t: float, period: float, trunk: TrunkState, q: FloatArray, v: FloatArray) -> FloatArray:
        """Joint torques (n,) [N m] at t [s] for the state of trunk and joints, in the model's joint order."""
        base, g = self._base, self._ground
        rotation = g.T @ trunk.rotation
        position, velocity, omega = g.T @ trunk.position, g.T @ trunk.velocity, g.T @ trunk.omega
        phase = self._phase(t)
        wanted = self._walk(t, period, position, velocity, rotation)
        acceleration, omega_dot = self._feedback(t, period, wanted, position, velocity, rotation, omega)
        w, dw = rotation.T @ omega, rotation.T @ omega_dot
        body_acceleration = rotation.T @ acceleration
        a = np.zeros(q.size)
        moved = base.state(q, v, a, w, body_acceleration, dw)
        centres, jacobians = base.contacts.jacobians(moved[0])
        bias = base.contacts.accelerations(*moved)
        motion = np.concatenate([rotation.T @ velocity, w, v])
        feet, feet_velocities = position + centres @ rotation.T, jacobians[:, :3] @ motion @ rotation.T
        wanted_feet = np.zeros((self._k, 3))
        for i in np.flatnonzero(phase >= 1.0):
            wanted_feet[i] = rotation.T @ self._swing(
                int(i), phase[i] - 1.0, feet[i], feet_velocities[i], position, velocity, rotation, wanted
            )
        self._swinging = phase >= 1.0
        legs = np.take_along_axis(jacobians[:, :3], FREE + self._leg_rows[:, None, :], axis=2)
        a[self._leg_rows] = np.linalg.solve(legs, (wanted_feet - bias)[:, :, None])[:, :, 0]
        specific = rotation.T @ (acceleration - self._gravity)
        wrench = self._inverse_dynamics(*base.state(q, v, a, w, specific, dw))
        normal = rotation.T @ np.array([0.0, 0.0, 1.0])
        points = jacobians[:, :3] + base.foot_radius[:, None, None] * (_skew(normal) @ jacobians[:, 3:])
        forces = self._share(wrench[:FREE], points[:, :, :FREE], phase, normal)
        return np.asarray(wrench[FREE:] - forces.ravel() @ points[:, :, FREE:].reshape(-1, q.size))

    def hold(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Joint torques (n,) [N m] that keep the legs as they are when first called: what a robot does that hangs in the air."""
        if self._held is None:
            self._held = q.copy()
        stiffness, damping = self._JOINT
        return stiffness * (self._held - q) - damping * v

    def resume(self, trunk: TrunkState) -> None:
        """Go on standing where the robot was set down."""
        self._held = None
        self._place = (self._ground.T @ trunk.position)[:2]
        self._linear_sum, self._angular_sum = np.zeros(3), np.zeros(3)

    def _inverse_dynamics(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        wrench = self._base.robot.rnea(q, v, a)
        if self.load[0] > 0.0:
            wrench += self._base.robot.payload_regressor(q, v, a, self._frame) @ self.load
        return wrench

    def _phase(self, t: float) -> FloatArray:
        phase = np.full(self._k, 0.5) if self._trot is None else self._trot.phase(t)
        if self.lifted is not None:
            phase[self.lifted] = 1.3
        return phase

    def _walk(self, t: float, period: float, position: FloatArray, velocity: FloatArray, rotation: FloatArray) -> FloatArray:
        """Wanted velocity over the ground (2,); moves the place that the trunk is to be at."""
        ahead, side, turn = self._motion.velocity(t)
        self._yaw += turn * period
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        wanted = np.array([c * ahead - s * side, s * ahead + c * side])
        self._place += wanted * period
        if self._trot is not None:
            error = position[:2] - self._place
            self._place += error * max(1.0 - 0.06 / max(float(np.linalg.norm(error)), 1e-9), 0.0)
            self._offset = np.clip(self._offset + 0.8 * error * period, -0.07, 0.07)
        return wanted

    def _feedback(
        self, t: float, period: float, wanted: FloatArray, position: FloatArray, velocity: FloatArray, rotation: FloatArray,
        omega: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        reference = self._motion.reference(t, self._place, self._yaw)
        shift = reference.position - position
        turn = rotation @ reference.rotation.T
        tilt = -0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        self._linear_sum = np.clip(self._linear_sum + shift * period, -0.03, 0.03)
        self._angular_sum = np.clip(self._angular_sum + tilt * period, -0.1, 0.1)
        kp, kd, ki = self._LINEAR
        speed = reference.velocity + np.array([*wanted, 0.0]) - velocity
        linear = reference.acceleration + kp * shift + kd * speed + ki * self._linear_sum
        kp, kd, ki = self._ANGULAR
        _, _, turning = self._motion.velocity(t)
        spin = reference.omega + np.array([0.0, 0.0, turning]) - omega
        angular = reference.omega_dot + kp * tilt + kd * spin + ki * self._angular_sum
        return linear, angular

    def _swing(
        self, i: int, s: float, foot: FloatArray, foot_velocity: FloatArray, position: FloatArray, velocity: FloatArray,
        rotation: FloatArray, wanted: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """Wanted acceleration of a foot in the air, in the ground's axes, at the share s of its swing."""
        kp, kd = self._FOOT
        radius = float(self._base.foot_radius[i])
        if not self._swinging[i]:
            self._lifted_from[i] = foot
        if self._trot is None or self.lifted == i:
            goal = self._lifted_from[i] + np.array([0.0, 0.0, self._LIFT])
            return np.asarray(kp / 9.0 * (goal - foot) - kd / 3.0 * foot_velocity)
        stand = self._trot.duty * self._trot.period
        shift = self.load[1:3] / (self._base.mass + self.load[0])
        hip = position + rotation @ np.array([*(self._hips[i] + shift), 0.0])
        drift = velocity[:2] - wanted
        target = (
            hip[:2] + 0.5 * stand * wanted + (0.5 * stand + 0.06) * drift + 0.35 * (position[:2] - self._place) + self._offset
        )
        duration = (1.0 - self._trot.duty) * self._trot.period
        u = min(s / 0.9, 1.0)
        blend, slope, bend = _quintic(u)
        rate = 1.0 / (0.9 * duration)
        start = self._lifted_from[i]
        way = np.array([*target, radius - 0.002]) - start
        # up and down again on the square of a half wave
        lift, lift_rate, lift_bend = 16 * u**2 * (1 - u) ** 2, 32 * u * (1 - u) * (1 - 2 * u), 32 * (1 - 6 * u + 6 * u**2)
        place = start + blend * way + np.array([0.0, 0.0, self._LIFT * lift])
        speed = rate * (slope * way + np.array([0.0, 0.0, self._LIFT * lift_rate]))
        acceleration = rate**2 * (bend * way + np.array([0.0, 0.0, self._LIFT * lift_bend])) if u < 1.0 else np.zeros(3)
        if u >= 1.0:
            speed = np.array([0.0, 0.0, -0.1])
        return np.asarray(acceleration + kp * (place - foot) + kd * (speed - foot_velocity))

    def _share(self, wrench: FloatArray, jacobians: FloatArray, phase: FloatArray, normal: FloatArray) -> FloatArray:
        """Forces on the feet, shape (k, 3): least squares over those that stand, in their friction cones."""
        weight = np.clip(np.minimum(phase, 1.0 - phase) / _STANCE_RAMP, 0.05, 1.0)
        standing = np.flatnonzero(phase < 1.0)
        forces = np.zeros((self._k, 3))
        if standing.size == 0:
            return forces
        scale = np.array([1.0, 1.0, 3.0, 15.0, 15.0, 5.0])
        columns = np.concatenate([jacobians[i].T * weight[i] for i in standing], axis=1) * scale[:, None]
        regular = 1e-2 * np.eye(columns.shape[1])
        solution = np.linalg.solve(columns.T @ columns + regular, columns.T @ (scale * wrench))
        shared = solution.reshape(-1, 3) * weight[standing, None]
        up = shared @ normal
        side = shared - np.outer(up, normal)
        up = np.maximum(up, _LEAST_FORCE)
        along = np.maximum(np.sqrt((side * side).sum(axis=1)), 1e-9)
        forces[standing] = np.outer(up, normal) + side * np.minimum(1.0, _FRICTION * up / along)[:, None]
        return forces


def _quintic(u: float) -> tuple[float, float, float]:
    return u**3 * (10 - 15 * u + 6 * u**2), 30 * u**2 * (1 - u) ** 2, 60 * u * (1 - 3 * u + 2 * u**2)


def _skew(x: FloatArray) -> FloatArray:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])
